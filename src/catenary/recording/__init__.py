"""Motion logs as files, ours and other people's."""
