"""The comparison of simulated LIDARs: every fifth column is kept, other files are there, and the whole set stays."""

import numpy as np
from lidar_density import thin_data_set


def test_a_thinned_data_set_keeps_every_fifth_column_of_all_rings(tmp_path):
    azimuth, distance = np.meshgrid(np.radians(0.18 * np.arange(-10, 11)), [5.0, 60.0])
    points = np.stack([distance * np.cos(azimuth), distance * np.sin(azimuth), -distance, 0 * distance], axis=-1)
    scan = tmp_path / "whole/2026_01_01/drive/velodyne_points/data/0000000000.bin"
    scan.parent.mkdir(parents=True)
    points.astype(np.float32).tofile(scan)
    (tmp_path / "whole/dataset.json").write_text("{}")
    for _ in range(2):
        thin = thin_data_set(tmp_path / "whole", tmp_path / "thin")
    kept = np.fromfile(thin / scan.relative_to(tmp_path / "whole"), np.float32).reshape(2, 5, 4)
    np.testing.assert_array_equal(kept, points[:, ::5].astype(np.float32))
    assert (thin / "dataset.json").read_text() == "{}"
    np.testing.assert_array_equal(np.fromfile(scan, np.float32), points.astype(np.float32).ravel())
    assert not list(tmp_path.glob("*under way*"))
