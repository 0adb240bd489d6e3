"""Slow, obvious twins of what the core does with packed bytes: they unpack."""


def lzw_size(data: bytes) -> int:
    """Length of what TIFF's LZW codes unpack to; -1 when a code has no meaning."""
    bits = "".join(f"{byte:08b}" for byte in data)
    strings: list[bytes] = []
    unpacked, before, at, width = b"", b"", 0, 9
    if bits[:9] != "100000000":
        return -1
    while at + width <= len(bits):
        code = int(bits[at : at + width], 2)
        at += width
        if code == 257:
            break
        if code == 256:
            strings, before, width = [bytes([value]) for value in range(256)] + [b"", b""], b"", 9
            continue
        if code < len(strings) and (before or code < 256):
            string = strings[code]
        elif code == len(strings) and before:
            string = before + before[:1]
        else:
            return -1
        if before and len(strings) < 4096:
            strings.append(before + string[:1])
            width = next((bits for bits in (9, 10, 11) if len(strings) < 2**bits - 1), 12)
        unpacked += string
        before = string
    return len(unpacked)


def packbits_size(data: bytes) -> int:
    """Length of what PackBits runs unpack to; -1 when one goes beyond the end."""
    rest, unpacked = data, b""
    while len(rest) > 1:
        head = rest[0]
        if head == 128:
            rest = rest[1:]
        elif head > 128:
            unpacked += rest[1:2] * (257 - head)
            rest = rest[2:]
        elif len(rest) < head + 2:
            return -1
        else:
            unpacked += rest[1 : head + 2]
            rest = rest[head + 2 :]
    return len(unpacked)
