"""Limits on what a client of a server sends, counted in the headers of its frames (ZMTP 3, rfc.zeromq.org/spec/23).

libzmq limits the size of one part of a message (ZMQ_MAXMSGSIZE), and keeps a message in memory until its last part has
arrived. It does not limit the number of parts, so that a client which never ends its message would use up the memory.
"""

from __future__ import annotations

MOST_REQUEST_BYTES = 65_536  # of a header
MOST_PARTS = 16  # of a message, with the envelope of proxies
_MOST_MESSAGE_BYTES = MOST_REQUEST_BYTES + 1_024  # with the envelope
# Sent over one connection to the stream. libzmq keeps some 40 bytes for each byte of a topic; the topics have 5 and 7.
MOST_SUBSCRIPTIONS, _MOST_SUBSCRIPTION_BYTES = 1_024, 16_384
# Encryption hides the ends of messages. A client can fill the queue of the server and the buffers of the kernel, which hold
# less, before the server answers it.
_MOST_UNANSWERED_FRAMES, _MOST_UNANSWERED_BYTES = 10_000, 8 * 2**20
_GREETING_BYTES = 64
_MORE, _LONG, _COMMAND = 1, 2, 4  # flags of a frame


class FrameLimits:
    """Limits on what one client sends: the frames of a connection are counted as they arrive.

    Parameters
    ----------
    is_curve : whether the connection is encrypted, so that the ends of messages cannot be seen
    is_stream : whether the client subscribes, and sends subscriptions only
    """

    refusal = b""

    def __init__(self, *, is_curve: bool = False, is_stream: bool = False) -> None:
        mechanism = (b"CURVE" if is_curve else b"NULL").ljust(20, b"\0")
        self._greeting = {0: 0xFF, 9: 0x7F, **{12 + k: byte for k, byte in enumerate(mechanism)}}
        self._is_curve, self._is_stream = is_curve, is_stream
        self._greeted = 0  # bytes of the greeting so far
        self._header = bytearray()  # of a frame, until it is complete
        self._left = 0  # bytes of the present frame that are still to come
        self._parts = self._bytes = 0  # of the present message, or since the last answer
        self._subscriptions = self._subscription_bytes = 0

    def admits(self, data: memoryview) -> bool:
        """Count the next bytes, and return whether they are within the limits."""
        at = min(len(data), _GREETING_BYTES - self._greeted)
        if at and not self._admits_greeting(data[:at]):
            return False
        while at < len(data):
            if self._left:
                step = min(self._left, len(data) - at)
                self._left -= step
                at += step
                continue
            self._header.append(data[at])
            at += 1
            flags = self._header[0]
            size_end = 9 if flags & _LONG else 2
            if len(self._header) < size_end + bool(flags & _COMMAND):  # the name of a command begins with its length
                continue
            if not self._admits_frame(flags, int.from_bytes(self._header[1:size_end]), self._header[-1]):
                return False
            self._header.clear()
        return True

    def note_answer(self) -> None:
        """Count anew: the server has answered."""
        if self._is_curve:
            self._parts = self._bytes = 0

    def _admits_greeting(self, data: memoryview) -> bool:
        for byte in data:
            if self._greeting.get(self._greeted, byte) != byte or (self._greeted == 10 and byte < 3):
                return False  # other mechanisms, and ZMTP before version 3, whose frames differ
            self._greeted += 1
        return True

    def _admits_frame(self, flags: int, size: int, name_length: int) -> bool:
        """Count a frame, and return whether it is within the limits.

        Parameters
        ----------
        flags, size : of its header: flags of ZMTP 3.1, and length [bytes]
        name_length : first byte of a command, the length of its name [bytes]
        """
        is_command = bool(flags & _COMMAND)
        if flags > 7 or size > MOST_REQUEST_BYTES or (is_command and (flags & _MORE or not size)):
            return False
        self._left = size - is_command
        if self._is_stream and not self._is_curve and not (is_command and name_length == 4):  # PING and PONG are free
            self._subscriptions += 1
            self._subscription_bytes += size
            if self._subscriptions > MOST_SUBSCRIPTIONS + 1 or self._subscription_bytes > _MOST_SUBSCRIPTION_BYTES:
                return False  # READY is one of them
        if self._is_curve:
            self._parts += 1
            self._bytes += size
            return self._parts <= _MOST_UNANSWERED_FRAMES and self._bytes <= _MOST_UNANSWERED_BYTES
        if is_command:  # libzmq can take one between the parts of a message
            return True
        self._parts += 1
        self._bytes += size
        if self._parts > MOST_PARTS or self._bytes > _MOST_MESSAGE_BYTES:
            return False
        if not flags & _MORE:
            self._parts = self._bytes = 0
        return True
