"""The command line, `semgrid-edu`."""
