"""Open a bag of ROS 1, ROS 2 or MCAP, and read the messages of its topics; no ROS is needed."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from semgrid_edu.errors import DataError, needed

EXPECTED = "a bag of ROS 1 (.bag), ROS 2 (its folder) or MCAP (.mcap)"
"""What can be opened."""


class Bag:
    """An open bag.

    Parameters
    ----------
    path : Path
        The file of ROS 1 or MCAP, or the folder of ROS 2.
    reader : rosbags.highlevel.AnyReader
        Its open reader.
    """

    def __init__(self, path: Path, reader: Any) -> None:
        self.path = path
        self._reader = reader

    def place(self, topic: str) -> str:
        """Return how errors call a topic.

        Parameters
        ----------
        topic : str
            Its name.
        """
        return f"{self.path}, topic {topic}"

    def count(self, topic: str, *types: str) -> int:
        """Check that a topic is there and has one of some types; return the number of its messages.

        Parameters
        ----------
        topic : str
            Its name.
        *types : str
            The types that its messages may have, such as "sensor_msgs/msg/Image".

        Raises
        ------
        DataError
            When there is no such topic, its type is another one, or it has no messages.
        """
        topics = self._reader.topics
        expected = f"{topic} of the type {' or '.join(map(_short, types))}"
        if topic not in topics:
            there = ", ".join(f"{name} ({_short(info.msgtype)})" for name, info in topics.items())
            raise DataError(self.path, f"the topic {expected}", f"only {there}" if there else "no topics")
        if topics[topic].msgtype not in types:
            raise DataError(self.path, f"the topic {expected}", f"the type {_short(topics[topic].msgtype)}")
        if not topics[topic].msgcount:
            raise DataError(self.place(topic), "messages", "none")
        return topics[topic].msgcount

    def messages(self, *topics: str) -> Iterator[tuple[str, Any]]:
        """Yield the messages of some topics, each with its topic, in the order of recording.

        Parameters
        ----------
        *topics : str
            The names of topics that are there.

        Raises
        ------
        DataError
            When a message can't be read.
        """
        connections = [one for one in self._reader.connections if one.topic in topics]
        try:
            for connection, _, raw in self._reader.messages(connections):
                yield connection.topic, self._reader.deserialize(raw, connection.msgtype)
        except Exception as error:  # a damaged file fails in whatever reads its bytes
            raise DataError(self.path, f"whole messages of {', '.join(topics)}", _said(error)) from error


@contextmanager
def open_bag(path: Path) -> Iterator[Bag]:
    """Open a bag while the block runs.

    Parameters
    ----------
    path : Path
        The file of ROS 1 or MCAP, or the folder of ROS 2.

    Yields
    ------
    Bag

    Raises
    ------
    DataError
        When there is no bag, or it can't be read.
    MissingExtraError
        When `rosbags` isn't installed.
    """
    highlevel = needed("rosbags.highlevel")
    typesys = needed("rosbags.typesys")
    if not path.exists():
        raise DataError(path, EXPECTED, "nothing of this name")
    if path.is_dir() and not (path / "metadata.yaml").exists():
        raise DataError(path, EXPECTED, "a folder without metadata.yaml")
    try:
        # Old bags of ROS 2 don't say what their messages consist of.
        reader = highlevel.AnyReader([path], default_typestore=typesys.get_typestore(typesys.Stores.LATEST))
        reader.open()
    except Exception as error:  # any bytes may be in the file
        raise DataError(path, EXPECTED, _said(error)) from error
    try:
        yield Bag(path, reader)
    finally:
        reader.close()


def _short(msgtype: str | None) -> str:
    """Return the name of a type as ROS 1 and people write it."""
    return (msgtype or "several types").replace("/msg/", "/")


def _said(error: Exception) -> str:
    """Return what an error of another library says, in one line."""
    return " ".join(str(error).split()) or type(error).__name__


def stamp_of(message: Any) -> int:
    """Return the time stamp of a message's header, nanoseconds since 1970.

    Parameters
    ----------
    message : message of ROS
        It has a header.
    """
    stamp = message.header.stamp
    return stamp.sec * 10**9 + stamp.nanosec


def frame_of(message: Any) -> str:
    """Return the name of the coordinate frame in a message's header, without the slash of old bags.

    Parameters
    ----------
    message : message of ROS
        It has a header.
    """
    return message.header.frame_id.lstrip("/")
