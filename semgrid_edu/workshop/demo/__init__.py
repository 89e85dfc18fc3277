"""The page that `semgrid-edu demo` writes: every stage of Fig. 2 over a drive, frame by frame."""

from semgrid_edu.workshop.demo.run import write_both_streets, write_demo

__all__ = ["write_both_streets", "write_demo"]
