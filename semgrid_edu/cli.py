"""The command line, `semgrid-edu`: parses and calls, nothing else."""

import typer

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)
data = typer.Typer(no_args_is_help=True, help="Make and check data.")
course = typer.Typer(no_args_is_help=True, help="Build the notebooks and the exercises.")
app.add_typer(data, name="data")
app.add_typer(course, name="course")


@app.callback()
def main() -> None:
    """Probabilistic bird's-eye semantic perception, taught notebook by notebook."""
