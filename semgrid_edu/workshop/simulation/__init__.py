"""A street that we know everything about, written as a KITTI raw drive (in place of the data of section 4)."""
