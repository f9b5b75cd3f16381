"""Parts of the panel's page, drawn by viser."""
