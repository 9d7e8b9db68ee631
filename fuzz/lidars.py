"""What must hold for any bytes from a lidar. A function raises ``AssertionError`` for an input that breaks it."""

from firmware_protocol.lidar import ld19, rplidar


def lidars_are_sound(data: bytes) -> None:
    """Chunks do not matter, what is read is what stands on the wire, and every byte is read, refused or kept."""
    _ld19_is_sound(data)
    for start in (b"", *map(rplidar.descriptor, rplidar.KINDS)):
        _rplidar_is_sound(start + data)


def _ld19_is_sound(data: bytes) -> None:
    whole, bytewise = ld19.Ld19Decoder(), ld19.Ld19Decoder()
    packets = whole.feed_bytes(data)
    assert packets == [packet for byte in data for packet in bytewise.feed_bytes(bytes([byte]))]
    assert whole.refused == bytewise.refused
    for packet in packets:
        assert ld19.encode(packet) in data
        assert all(0 <= angle < ld19.FULL_TURN_CDEG for angle in packet.angles_cdeg())


def _rplidar_is_sound(data: bytes) -> None:
    whole, bytewise = rplidar.RplidarDecoder(), rplidar.RplidarDecoder()
    answers = whole.feed_bytes(data)
    assert answers == [answer for byte in data for answer in bytewise.feed_bytes(bytes([byte]))]
    assert whole.refused == bytewise.refused
    for answer in answers:
        if isinstance(answer, rplidar.ScanNode):
            assert rplidar.encode_node(answer) in data
        elif isinstance(answer, rplidar.Capsule):
            assert rplidar.encode_capsule(answer) in data
            assert all(0 <= angle < rplidar.FULL_TURN_Q6 for angle in answer.angles_q6(0))
