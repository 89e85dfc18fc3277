"""Messages between two processes: each is its length in eight bytes, then its bytes."""

from typing import BinaryIO

LONGEST = 200_000_000
"""Bytes of a message that are still read."""


class Wire:
    """Both directions of a connection.

    Parameters
    ----------
    incoming, outgoing : binary file
        The two pipes.
    """

    def __init__(self, incoming: BinaryIO, outgoing: BinaryIO) -> None:
        self.incoming, self.outgoing = incoming, outgoing

    def send(self, message: bytes) -> None:
        """Send a message.

        Parameters
        ----------
        message : bytes
            The message.
        """
        self.outgoing.write(len(message).to_bytes(8, "big") + message)
        self.outgoing.flush()

    def receive(self) -> bytes | None:
        """Return the next message; None when the other side has hung up, or sends what is no message."""
        head = self.incoming.read(8)
        length = int.from_bytes(head, "big")
        if len(head) < 8 or length > LONGEST:
            return None
        message = self.incoming.read(length)
        return message if len(message) == length else None
