"""What the documentation site is built with, beside zensical.toml: mathematics, the theme's own files."""
