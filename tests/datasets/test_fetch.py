"""Archives are fetched over connections that break, checked, and unpacked whole, into their folder alone."""

import hashlib
import io
import stat
import zipfile

import pytest
from archive_server import serve
from tiny_drive import DATE, write_tiny_drive

from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.errors import DataError
from semgrid_edu.workshop.commands import fetch
from semgrid_edu.workshop.commands import main as cli
from semgrid_edu.workshop.commands.fetch import fetch_kitti, unpack_zip

DRIVE = f"{DATE}_0001"
CALIB = f"/{DATE}_calib.zip"
SYNC = f"/{DATE}_drive_0001/{DATE}_drive_0001_sync.zip"


@pytest.fixture(autouse=True)
def no_waiting(monkeypatch):
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    monkeypatch.setattr("pooch.core.time.sleep", lambda seconds: None)
    monkeypatch.setattr(fetch, "CHUNK", 100)


@pytest.fixture(scope="session")
def original(tmp_path_factory):
    """The drive from which the archives are made."""
    root = tmp_path_factory.mktemp("original")
    write_tiny_drive(root)
    return root


@pytest.fixture(scope="session")
def archives(original):
    """What the server holds: KITTI's two archives, whose names begin with the day's folder."""
    drive = original / DATE / f"{DATE}_drive_0001_sync"
    return {
        CALIB: zipped({f"{DATE}/{path.name}": path.read_bytes() for path in (original / DATE).glob("calib_*.txt")}),
        SYNC: zipped(
            {str(path.relative_to(original)): path.read_bytes() for path in drive.rglob("*") if path.is_file()}
        ),
    }


def zipped(files):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return buffer.getvalue()


def contents(root):
    return {path.relative_to(root): path.read_bytes() for path in (root / DATE).rglob("*") if path.is_file()}


class TestDownload:
    def test_goes_on_where_a_connection_breaks_off(self, tmp_path, original, archives):
        with serve(archives, break_after=[10**9, 5000, 3000]) as (source, requests):
            fetch_kitti(tmp_path, DRIVE, source)
        assert requests == [(CALIB, None), (SYNC, None), (SYNC, "bytes=5000-"), (SYNC, "bytes=8000-")]
        assert contents(tmp_path) == contents(original)

    def test_an_overloaded_server_is_asked_again(self, tmp_path, original, archives):
        with serve(archives, break_after=[None, None]) as (source, requests):
            fetch_kitti(tmp_path, DRIVE, source)
        assert [path for path, _ in requests] == [CALIB, CALIB, CALIB, SYNC]
        assert contents(tmp_path) == contents(original)

    def test_goes_on_in_another_process(self, tmp_path, original, archives):
        # Each answer brings 100 bytes, so that all five attempts at the calibration break off.
        with (
            serve(archives, break_after=[100] * 5) as (source, _),
            pytest.raises(DataError, match=r"put .*_calib.zip and .*_sync.zip into .*archives by hand"),
        ):
            fetch_kitti(tmp_path, DRIVE, source)
        assert not (tmp_path / DATE).exists()
        with serve(archives) as (source, requests):
            fetch_kitti(tmp_path, DRIVE, source)
        assert requests[0] == (CALIB, "bytes=500-")
        assert contents(tmp_path) == contents(original)

    @pytest.mark.parametrize("server", [{}, {"ranges": False}])
    def test_begins_anew_where_the_server_does_not_go_on(self, tmp_path, original, archives, server):
        with serve(archives, break_after=[100], **server) as (source, _):
            fetch_kitti(tmp_path, DRIVE, source)
        assert contents(tmp_path) == contents(original)

    def test_parts_of_two_versions_are_not_taken_for_an_archive(self, tmp_path, archives):
        changed = zipped({f"{DATE}/calib_cam_to_cam.txt": b"x" * 30000})
        broken = serve(archives | {CALIB: changed}, break_after=[100] * 5)
        with broken as (source, _), pytest.raises(DataError, match="ChunkedEncodingError"):
            fetch_kitti(tmp_path, DRIVE, source)
        with serve(archives) as (source, _), pytest.raises(DataError, match="delete it to download it again"):
            fetch_kitti(tmp_path, DRIVE, source)
        assert not (tmp_path / DATE).exists()

    def test_what_is_there_is_not_fetched_again(self, tmp_path, archives):
        with serve(archives) as (source, requests):
            fetch_kitti(tmp_path, DRIVE, source)
            fetch_kitti(tmp_path, DRIVE, source)
        assert len(requests) == 2


class TestChecksums:
    def test_the_first_archive_is_recorded(self, tmp_path, archives):
        with serve(archives) as (source, _):
            fetch_kitti(tmp_path, DRIVE, source)
        expected = {path.rpartition("/")[2]: hashlib.sha256(content).hexdigest() for path, content in archives.items()}
        assert dict(map(str.split, (tmp_path / "archives" / "registry.txt").read_text().splitlines())) == expected

    def test_another_archive_than_recorded_is_refused(self, tmp_path, archives):
        (tmp_path / "archives").mkdir()
        known = hashlib.sha256(b"something else").hexdigest()
        (tmp_path / "archives" / "registry.txt").write_text(f"{CALIB[1:]} {known}\n")
        with serve(archives) as (source, _), pytest.raises(DataError, match=f"expected the SHA-256 {known} that"):
            fetch_kitti(tmp_path, DRIVE, source)
        assert not (tmp_path / DATE).exists()
        assert [path.name for path in (tmp_path / "archives").iterdir()] == ["registry.txt"]

    def test_a_damaged_registry_is_named(self, tmp_path, archives):
        (tmp_path / "archives").mkdir()
        (tmp_path / "archives" / "registry.txt").write_text("one two three four\n")
        with pytest.raises(DataError, match=r"registry.txt: expected lines `name sha256`"):
            fetch_kitti(tmp_path, DRIVE, "http://127.0.0.1:1")

    def test_a_damaged_archive_is_not_recorded(self, tmp_path, archives):
        with (
            serve(archives | {CALIB: archives[CALIB][:-30]}) as (source, _),
            pytest.raises(
                DataError, match=r"calib.zip: expected a sound zip archive, .* delete it to download it again"
            ),
        ):
            fetch_kitti(tmp_path, DRIVE, source)
        assert not (tmp_path / "archives" / "registry.txt").exists()


class TestWithoutNetwork:
    def test_says_which_files_to_put_where(self, tmp_path):
        source = "http://127.0.0.1:1"
        place = f"put {source}{CALIB} and {source}{SYNC} into {tmp_path / 'archives'} by hand and call this again"
        with pytest.raises(
            DataError, match=f"{CALIB}: expected an answer of the server, found ConnectionError; .*{place}"
        ):
            fetch_kitti(tmp_path, DRIVE, source)

    def test_archives_put_there_by_hand_are_unpacked(self, tmp_path, original, archives):
        for path, content in archives.items():
            target = tmp_path / "archives" / path.rpartition("/")[2]
            target.parent.mkdir(exist_ok=True)
            target.write_bytes(content)
        fetch_kitti(tmp_path, DRIVE, "http://127.0.0.1:1")
        assert contents(tmp_path) == contents(original)

    def test_a_drive_that_there_is_not(self, tmp_path, archives):
        with serve(archives) as (source, _), pytest.raises(DataError, match="404 Not Found: is there such a drive"):
            fetch_kitti(tmp_path, f"{DATE}_0099", source)


class TestUnpacking:
    @pytest.mark.parametrize(
        "name",
        ["../outside.txt", f"{DATE}/../../outside.txt", "/etc/outside", "other/a.txt", "..\\outside.txt", "C:/a"],
    )
    def test_nothing_leaves_the_folder(self, tmp_path, name):
        archive = tmp_path / "evil.zip"
        archive.write_bytes(zipped({f"{DATE}/sound.txt": b"", name: b"evil"}))
        unpack_zip(archive, tmp_path / "into", DATE)
        assert sorted(tmp_path.iterdir()) == [archive, tmp_path / "into"]
        assert list((tmp_path / "into").iterdir()) == [tmp_path / "into" / DATE]

    def test_links_become_plain_files(self, tmp_path):
        link = zipfile.ZipInfo(f"{DATE}/link")
        link.external_attr = (stat.S_IFLNK | 0o777) << 16
        with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
            archive.writestr(link, "/etc/passwd")
        unpack_zip(tmp_path / "a.zip", tmp_path, DATE)
        assert not (tmp_path / DATE / "link").is_symlink()
        assert (tmp_path / DATE / "link").read_text() == "/etc/passwd"

    def test_an_archive_of_something_else_is_named(self, tmp_path):
        (tmp_path / "a.zip").write_bytes(zipped({"other/a.txt": b""}))
        with pytest.raises(DataError, match=f"expected a folder {DATE} in the archive"):
            unpack_zip(tmp_path / "a.zip", tmp_path / "into", DATE)

    def test_a_file_damaged_within_leaves_nothing(self, tmp_path):
        content = zipped({f"{DATE}/a.txt": b"sound", f"{DATE}/b.txt": b"damaged"})
        (tmp_path / "a.zip").write_bytes(content.replace(b"damaged", b"dAmaged"))
        with pytest.raises(DataError, match="Bad CRC-32"):
            unpack_zip(tmp_path / "a.zip", tmp_path / "into", DATE)
        assert not (tmp_path / "into" / DATE).exists()
        assert list((tmp_path / "into").glob(".*")) == []


def test_the_command_fetches_and_tells_the_licence(tmp_path, archives, monkeypatch, capsys):
    with serve(archives) as (source, _):
        monkeypatch.setattr(fetch.fetch_kitti, "__defaults__", (source,))
        arguments = ["data", "fetch", "kitti", "--drive", DRIVE, "--folder", str(tmp_path)]
        monkeypatch.setattr("sys.argv", ["semgrid-edu", *arguments])
        with pytest.raises(SystemExit) as caught:
            cli.run()
    assert caught.value.code in (None, 0)
    printed = capsys.readouterr().out
    assert "forbids commercial use" in printed
    assert "holds the drive, frames: 3;" in printed
    assert len(KittiRawDrive(tmp_path, DATE, "0001")) == 3
