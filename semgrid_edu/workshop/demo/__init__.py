"""The page that `semgrid-edu demo` writes: every stage of Fig. 2 over a drive, and the story of every cell."""

from semgrid_edu.workshop.demo.run import write_both_streets, write_demo
from semgrid_edu.workshop.demo.stories import cell_story

__all__ = ["cell_story", "write_both_streets", "write_demo"]
