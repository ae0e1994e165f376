"""What a shell completes besides commands and options: robots' names. Files it completes by itself."""


def robots_beginning(incomplete: str) -> list[str]:
    """Return names in the catalogue that begin with what was typed."""
    from catenary.robots.catalog import robot_names

    return [name for name in robot_names() if name.startswith(incomplete)]
