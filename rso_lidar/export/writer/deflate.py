"""DEFLATE compression of images that are mostly empty: runs of equal bytes with Huffman codes.

HDF5's filters shuffle and gzip store the first bytes of all pixels, then their second bytes, and so on, as a zlib
stream (RFC 1950, RFC 1951). zlib with its run-length strategy makes an equivalent stream, but inspects every byte.
These kernels compare each pixel with the previous one, eight bytes at a time, and inspect only pixels that differ.

Calls between kernels pass ``int(CONSTANT)``, because numba compiles a separate function for each literal argument.
"""

from __future__ import annotations

import numpy as np

from rso_lidar.kernels import kernel

_BLOCK = 16384  # most tokens of a block; each block has its own Huffman codes, as in zlib
_LEAST_BLOCK = 2048  # tokens after which the end of a byte plane starts a new block
_ADLER = 65521  # modulus of Adler-32
_MATCH = 256  # added to the length of a match, to tell it from a literal
_LONGEST_MATCH = 258
_SHORTEST_MATCH = 3
_END = 256  # symbol of the end of a block
_SYMBOLS = 286  # literals, the end of a block, and lengths of matches
_LONGEST_CODE = 15  # bits
_LONGEST_META_CODE = 7  # bits of a code for lengths of codes
_HEAD_BITS = 17  # last block or not, kind of block, and the numbers of its codes
_META_LENGTH_BITS = 3
_SORT_GAPS = (57, 23, 10, 4, 1)  # M. Ciura, FCT 2001
_META_ORDER = np.array([16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15])  # RFC 1951, sec. 3.2.7
_META_BITS = np.array([0] * 16 + [2, 3, 7])  # extra bits
_LENGTH_BITS = np.array([0] * 8 + [1] * 4 + [2] * 4 + [3] * 4 + [4] * 4 + [5] * 4 + [0])  # extra bits, sec. 3.2.5
_LENGTH_FIRST = np.append(3 + np.cumsum(np.append(0, 1 << _LENGTH_BITS[:27])), _LONGEST_MATCH)  # of each symbol
_kind = np.searchsorted(_LENGTH_FIRST, np.arange(_LONGEST_MATCH + 1), side="right") - 1
_TOKEN_SYMBOL = np.append(np.arange(_MATCH), 257 + _kind)  # of literals and matches
_TOKEN_EXTRA = np.append(np.zeros(_MATCH, int), np.arange(_LONGEST_MATCH + 1) - _LENGTH_FIRST[_kind])
_TOKEN_BITS = np.append(np.zeros(_MATCH, int), _LENGTH_BITS[_kind] + 1)  # one more for the distance


def bound_stream(count: int) -> int:
    """Return an upper bound of the length of a stream [bytes]: no code is longer than 15 bits."""
    return 2 * count + 1000


@kernel
def find_changes(data: np.ndarray, words: np.ndarray, size: int, changes: np.ndarray) -> int:
    """Find the items that differ from the previous one; the first item counts as a change.

    Parameters
    ----------
    data : bytes (byte) of the items
    words : the complete 64-bit words of the same memory
    size : bytes of an item; it divides 8
    changes : receives the indices of the items found (item)

    Returns
    -------
    int
        Number of items found.
    """
    count, per_word = len(data) // size, 8 // size
    n_changes, item, is_even = 0, 0, False
    while item < count:
        if is_even:  # all items of the word before are equal
            word = item // per_word
            same = words[word - 1]
            while word + 8 <= len(words):
                differences = same ^ same
                for k in range(8):
                    differences |= words[np.uintp(word + k)] ^ same  # of a word that is positive for sure
                if differences:
                    break
                word += 8
            while word < len(words) and words[word] == same:
                word += 1
            item = word * per_word
        is_even = item // per_word < len(words)
        first = item
        while item < min(first + per_word, count):
            differs = item == 0
            for byte in range(item * size, item * size + size):
                if not differs and data[byte] != data[byte - size]:
                    differs = True
            if differs:
                changes[n_changes] = item
                n_changes += 1
                is_even = is_even and item == first
            item += 1
    return n_changes


@kernel
def split_into_tokens(
    data: np.ndarray, size: int, changes: np.ndarray, tokens: np.ndarray, plane_ends: np.ndarray
) -> tuple[int, int]:
    """Write the byte planes of items as literals and matches of the previous byte.

    Parameters
    ----------
    data : bytes (byte) of the items
    size : bytes of an item, and number of planes
    changes : indices (change) of the items that differ from the previous one
    tokens : receives literals below 256, and `_MATCH` + length for matches
    plane_ends : receives the number of tokens at the end of each plane (size)

    Returns
    -------
    tuple
        Number of tokens, and Adler-32 of the planes.
    """
    count = len(data) // size
    n_tokens, value, run = 0, -1, 0
    low, high = 1, 0
    for plane in range(size):
        for k in range(len(changes)):
            start = changes[k]
            stop = changes[k + 1] if k + 1 < len(changes) else count
            length, byte = stop - start, int(data[start * size + plane])
            high += length * low + byte * (length * (length + 1) // 2)
            low += length * byte
            if byte == value:
                run += length
                continue
            n_tokens = _end_run(tokens, int(n_tokens), int(value), int(run))
            tokens[n_tokens] = byte
            n_tokens += 1
            value, run = byte, length - 1
        n_tokens = _end_run(tokens, int(n_tokens), int(value), int(run))
        run = 0
        plane_ends[plane] = n_tokens
        low, high = low % _ADLER, high % _ADLER
    return n_tokens, high << 16 | low


@kernel
def _end_run(tokens: np.ndarray, n_tokens: int, value: int, run: int) -> int:
    """Write the rest of a run of equal bytes as matches and literals; return the number of tokens.

    Parameters
    ----------
    tokens : written in place
    n_tokens : number of tokens so far
    run : number of bytes that remain
    """
    while run >= _SHORTEST_MATCH:
        length = min(run, _LONGEST_MATCH)
        tokens[n_tokens] = _MATCH + length
        n_tokens += 1
        run -= length
    for _ in range(run):
        tokens[n_tokens] = value
        n_tokens += 1
    return n_tokens


@kernel
def find_codes(frequencies: np.ndarray, longest: int, lengths: np.ndarray, codes: np.ndarray) -> None:
    """Find Huffman codes of limited length.

    Method: A. Moffat, J. Katajainen, "In-place calculation of minimum-redundancy codes", WADS 1995. Codes longer than
    the limit are shortened, and shorter ones are lengthened until the Kraft sum is 1.

    Parameters
    ----------
    frequencies : of the symbols (symbol), at least two of them above 0
    longest : greatest length of a code [bits]
    lengths : receives the lengths of the codes (symbol) [bits], 0 for symbols that do not occur
    codes : receives the codes (symbol), first bit lowest
    """
    symbols = np.empty(len(frequencies), np.int64)
    n = 0
    for symbol in range(len(frequencies)):
        if frequencies[symbol] > 0:
            symbols[n] = symbol
            n += 1
    for gap in _SORT_GAPS:  # Shell's sort, by frequency
        for start in range(gap, n):
            symbol, k = symbols[start], start
            while k >= gap and frequencies[symbols[k - gap]] > frequencies[symbol]:
                symbols[k] = symbols[k - gap]
                k -= gap
            symbols[k] = symbol
    nodes = np.empty(n, np.int64)
    for k in range(n):
        nodes[k] = frequencies[symbols[k]]
    nodes[0] += nodes[1]
    root, leaf = 0, 2
    for k in range(1, n - 1):
        total = 0
        for pair in range(2):
            if leaf >= n or ((pair == 0 or root < k) and nodes[root] < nodes[leaf]):
                total += nodes[root]
                nodes[root] = k
                root += 1
            else:
                total += nodes[leaf]
                leaf += 1
        nodes[k] = total
    nodes[n - 2] = 0
    for k in range(n - 3, -1, -1):
        nodes[k] = nodes[nodes[k]] + 1
    counts = np.zeros(longest + 1, np.int64)
    free, used, depth, root = 1, 0, 0, n - 2
    while free > 0:
        while root >= 0 and nodes[root] == depth:
            used += 1
            root -= 1
        counts[min(depth, longest)] += free - used
        free, used, depth = 2 * used, 0, depth + 1
    kraft = 0
    for length in range(1, longest + 1):
        kraft += counts[length] << (longest - length)
    while kraft > 1 << longest:
        counts[longest] -= 1
        length = longest - 1
        while counts[length] == 0:
            length -= 1
        counts[length] -= 1
        counts[length + 1] += 2
        kraft -= 1
    following = np.zeros(longest + 1, np.int64)
    k = n
    for length in range(1, longest + 1):
        following[length] = (following[length - 1] + counts[length - 1]) << 1
        for _ in range(counts[length]):
            k -= 1
            lengths[symbols[k]] = length
    for symbol in range(len(frequencies)):  # canonical codes, RFC 1951, sec. 3.2.2, their first bit lowest
        code = following[lengths[symbol]]
        following[lengths[symbol]] += 1
        for _ in range(lengths[symbol]):
            codes[symbol], code = codes[symbol] << 1 | code & 1, code >> 1


@kernel
def _put(out: np.ndarray, state: np.ndarray, value: int, width: int) -> None:
    """Append bits of a value, lowest first.

    Parameters
    ----------
    value : non-negative, with `width` bits
    width : number of bits
    """
    place, waiting, bits = state[0], state[1] | value << state[2], state[2] + width
    while bits >= 8:
        out[place] = waiting & 0xFF
        place, waiting, bits = place + 1, waiting >> 8, bits - 8
    state[0], state[1], state[2] = place, waiting, bits


@kernel
def put_block(out: np.ndarray, state: np.ndarray, tokens: np.ndarray, head: int) -> None:
    """Append tokens as one block with its own Huffman codes (RFC 1951, sec. 3.2.7).

    Parameters
    ----------
    tokens : literals and matches (token)
    head : first three bits of the block: whether it is the last, and its type
    """
    lengths, codes = np.zeros(_SYMBOLS + 1, np.int64), np.zeros(_SYMBOLS + 1, np.int64)
    frequencies = np.zeros(_SYMBOLS, np.int64)
    frequencies[_END] = 1
    for k in range(len(tokens)):
        frequencies[_TOKEN_SYMBOL[tokens[k]]] += 1
    find_codes(frequencies, int(_LONGEST_CODE), lengths, codes)
    sent = _SYMBOLS
    while lengths[sent - 1] == 0:
        sent -= 1
    lengths[sent] = 1  # of the code for the one distance that occurs, which is a zero

    symbols, extras = np.empty(sent + 1, np.int64), np.empty(sent + 1, np.int64)
    counts, n, k = np.zeros(19, np.int64), 0, 0
    while k <= sent:
        length, run, most = lengths[k], 1, 138 if lengths[k] == 0 else 6
        if length and (k == 0 or length != lengths[k - 1]):
            most = 1
        while run < most and k + run <= sent and lengths[k + run] == length:
            run += 1
        symbols[n], extras[n] = length, 0
        if run < 3:
            run = 1
        elif length:
            symbols[n], extras[n] = 16, run - 3
        elif run <= 10:
            symbols[n], extras[n] = 17, run - 3
        else:
            symbols[n], extras[n] = 18, run - 11
        counts[symbols[n]] += 1
        n, k = n + 1, k + run
    meta_lengths, meta_codes = np.zeros(19, np.int64), np.zeros(19, np.int64)
    find_codes(counts, int(_LONGEST_META_CODE), meta_lengths, meta_codes)
    metas = 19
    while metas > 4 and meta_lengths[_META_ORDER[metas - 1]] == 0:
        metas -= 1

    _put(out, state, int(head | (sent - 257) << 3 | (metas - 4) << 13), int(_HEAD_BITS))
    for k in range(metas):
        _put(out, state, meta_lengths[_META_ORDER[k]], int(_META_LENGTH_BITS))
    for k in range(n):
        symbol, bits = symbols[k], meta_lengths[symbols[k]]
        _put(out, state, meta_codes[symbol] | extras[k] << bits, bits + _META_BITS[symbol])
    for k in range(len(tokens)):
        symbol, bits = _TOKEN_SYMBOL[tokens[k]], lengths[_TOKEN_SYMBOL[tokens[k]]]
        _put(out, state, codes[symbol] | _TOKEN_EXTRA[tokens[k]] << bits, bits + _TOKEN_BITS[tokens[k]])
    _put(out, state, codes[_END], lengths[_END])


@kernel
def deflate_planes(
    data: np.ndarray, words: np.ndarray, size: int, changes: np.ndarray, tokens: np.ndarray, out: np.ndarray
) -> int:
    """Compress the byte planes of items to a zlib stream; return the length of the stream [bytes].

    Parameters
    ----------
    data : bytes (byte) of the items, one or more
    words : the complete 64-bit words of the same memory
    size : bytes of an item; it divides 8
    changes : scratch space (item)
    tokens : scratch space (byte)
    out : receives the stream; `bound_stream` bounds its length
    """
    plane_ends = np.empty(size, np.int64)
    n_changes = find_changes(data, words, size, changes)
    count, adler = split_into_tokens(data, size, changes[:n_changes], tokens, plane_ends)
    out[0], out[1] = 0x78, 0x01  # window of 32 KiB, fastest
    state = np.array([2, 0, 0])
    start = 0
    while start < count:
        stop = min(start + _BLOCK, count)
        for end in plane_ends:
            if start + _LEAST_BLOCK <= end < stop:
                stop = int(end)
        put_block(out, state, tokens[start:stop], 4 | (stop == count))
        start = stop
    place = int(state[0])
    if state[2]:
        out[place] = state[1]
        place += 1
    for k in range(4):
        out[place + k] = adler >> (24 - 8 * k) & 0xFF
    return place + 4
