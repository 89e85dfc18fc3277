"""`python -m semgrid_edu` is `semgrid-edu`: the door from the street to the workshop."""

from semgrid_edu.workshop.commands.main import run

if __name__ == "__main__":
    run()
