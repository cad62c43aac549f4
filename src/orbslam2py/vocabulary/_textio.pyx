# SPDX-License-Identifier: BSD-3-Clause
# cython: language_level=3, boundscheck=False, wraparound=False
"""Large text tables: vocabularies in the format of ORBvoc.txt.

Rows are scanned into NumPy columns without a Python object per line, in blocks, so that plain and
compressed files take the same way and the file itself never lies in memory as a whole.
"""

from libc.math cimport NAN
from libc.stdint cimport uint8_t, uint32_t
from libc.string cimport memchr, memmove
from libcpp.vector cimport vector

import numpy as np

from orbslam2py.errors import VocabularyError

cdef extern from "<charconv>" namespace "std" nogil:
    cdef cppclass to_chars_result:
        char* ptr
    to_chars_result to_chars_integer "std::to_chars"(char* first, char* last, unsigned int value)

# Independent of the locale, unlike strtod and printf.
cdef extern from "base/number_text.hpp" namespace "orbslam" nogil:
    const char* read_number(const char* first, const char* last, double& value)
    char* write_number(char* first, char* last, double value)

cdef enum:
    BLOCK = 1 << 20
    LONGEST_LINE = 4096
    N_BYTES = 32
    N_FIELDS = 35
    MOST_NODES = 0x7FFFFFFE
    MOST_EMPTY_LINES = 1 << 20

cdef struct Columns:
    uint32_t* parents
    uint8_t* is_word
    uint8_t* centres
    double* weights
    size_t count
    size_t capacity


cdef inline const char* skip_blanks(const char* at, const char* end) noexcept nogil:
    while at < end and (at[0] == c" " or at[0] == c"\t" or at[0] == c"\r"):
        at += 1
    return at


cdef inline const char* scan_integer(
    const char* at, const char* end, uint32_t limit, uint32_t* value
) noexcept nogil:
    """One decimal number up to `limit` and the blanks around it; NULL when there is none."""
    cdef unsigned long long number = 0
    cdef const char* begin
    at = skip_blanks(at, end)
    begin = at
    while at < end and c"0" <= at[0] <= c"9":
        number = 10 * number + <unsigned int>(at[0] - c"0")
        if number > limit:
            return NULL
        at += 1
    if at == begin or (at < end and at[0] != c" " and at[0] != c"\t" and at[0] != c"\r"):
        return NULL
    value[0] = <uint32_t>number
    return at


cdef bint scan_node(const char* at, const char* end, Columns* columns) noexcept nogil:
    """Append the node of one line; False when the line is malformed."""
    cdef uint32_t value = 0
    cdef size_t row = columns.count
    cdef int i
    cdef double weight = NAN  # stays so when the number is out of range; the tree's check finds it
    cdef const char* behind
    at = scan_integer(at, end, MOST_NODES, &value)
    if at == NULL:
        return False
    columns.parents[row] = value
    at = scan_integer(at, end, 1, &value)
    if at == NULL:
        return False
    columns.is_word[row] = <uint8_t>value
    for i in range(N_BYTES):
        at = scan_integer(at, end, 255, &value)
        if at == NULL:
            return False
        columns.centres[N_BYTES * row + i] = <uint8_t>value
    at = skip_blanks(at, end)
    if at < end and at[0] == c"+":
        at += 1
    behind = read_number(at, end, weight)
    if behind == at or skip_blanks(behind, end) != end:
        return False
    columns.weights[row] = weight
    columns.count += 1
    return True


cdef const char* scan_block(
    const char* at, const char* end, Columns* columns, vector[size_t]* empty_lines
) noexcept nogil:
    """Scan whole lines while there is room; returns where it stopped (a bad line, no room, end)."""
    cdef const char* newline
    while at < end and columns.count < columns.capacity:
        newline = <const char*>memchr(at, c"\n", end - at)
        if newline == NULL:
            break
        if skip_blanks(at, newline) == newline:
            if empty_lines.size() >= MOST_EMPTY_LINES:
                break
            empty_lines.push_back(columns.count)
        elif not scan_node(at, newline, columns):
            break
        at = newline + 1
    return at


def _describe_bad_line(bytes line):
    """Say what is wrong with a line of a node."""
    fields = line.split()
    if not fields:
        return "too many empty lines"
    if len(fields) != N_FIELDS:
        return f"{len(fields)} fields, expected {N_FIELDS}"
    if not (fields[0].isdigit() and int(fields[0]) <= MOST_NODES):
        return "the parent is not a node number"
    if fields[1] not in (b"0", b"1"):
        return "the second field must be 1 (word) or 0 (inner node)"
    for field in fields[2 : N_FIELDS - 1]:
        if not (field.isdigit() and int(field) <= 255):
            return f"'{field.decode(errors='replace')}' is not a descriptor byte (0 to 255)"
    return f"'{fields[N_FIELDS - 1].decode(errors='replace')}' is not a weight"


def read_header(bytes line):
    """Branching, depth, scoring and weighting of the first line.

    Raises
    ------
    VocabularyError
        If it is not the first line of a vocabulary.
    """
    fields = line.split()
    if len(fields) != 4 or not all(field.isdigit() and len(field) < 4 for field in fields):
        raise VocabularyError("line 1: not a vocabulary file, expected four numbers")
    values = tuple(int(field) for field in fields)
    limits = (("branching", 2, 20), ("depth", 1, 10), ("scoring", 0, 5), ("weighting", 0, 3))
    for value, (name, low, high) in zip(values, limits):
        if not low <= value <= high:
            raise VocabularyError(
                f"line 1: not a vocabulary file, {name} is {value}, must be {low} to {high}"
            )
    return values


def read_vocabulary_text(source, size_hint=0, progress=None):
    """Read nodes from a binary stream (anything with ``readinto``).

    Parameters
    ----------
    source : file object
    size_hint : int
        Expected number of bytes, to reserve memory; 0 when unknown.
    progress : callable, optional
        Called with the number of bytes read so far.

    Returns
    -------
    tuple
        Header (branching, depth, scoring, weighting); columns (parents uint32 (n,), is_word uint8
        (n,), centres uint8 (n, 32), weights float64 (n,)) without the root; for each empty line
        the number of nodes before it.

    Raises
    ------
    VocabularyError
        Naming the first malformed line.
    """
    cdef bytearray buffer = bytearray(BLOCK)
    cdef char* begin = buffer
    cdef const char* at
    cdef const char* end
    cdef size_t filled = 0
    cdef size_t n_read
    cdef Columns columns
    cdef vector[size_t] empty_lines
    cdef uint32_t[::1] parents
    cdef uint8_t[::1] is_word
    cdef uint8_t[:, ::1] centres
    cdef double[::1] weights
    view = memoryview(buffer)
    header = None
    total = 0
    # No line is shorter than 70 characters; memory that is reserved but never written costs nothing.
    arrays = _reserve(None, max(1024, size_hint // 70))
    columns.count = 0
    columns.capacity = 0
    while True:
        n_read = source.readinto(view[filled:])
        total += n_read
        filled += n_read
        if n_read == 0:
            if filled == 0:
                break
            buffer[filled] = 10  # the last line may end with the file
            filled += 1
        at = begin
        end = begin + filled
        if header is None:
            length = buffer.find(b"\n", 0, filled)
            if length < 0:
                raise VocabularyError("line 1: not a vocabulary file, the line is too long")
            header = read_header(bytes(buffer[:length]))
            at += length + 1
        while True:
            if columns.count == columns.capacity:
                if columns.capacity > 0:
                    arrays = _reserve(arrays, 2 * columns.capacity)
                parents, is_word, centres, weights = arrays
                columns.parents = &parents[0]
                columns.is_word = &is_word[0]
                columns.centres = &centres[0, 0]
                columns.weights = &weights[0]
                columns.capacity = parents.shape[0]
            with nogil:
                at = scan_block(at, end, &columns, &empty_lines)
            if columns.count < columns.capacity:
                break
        if columns.count >= MOST_NODES:
            raise VocabularyError("too many nodes")
        _check_stop(buffer, at - begin, filled, columns.count + empty_lines.size() + 2)
        filled = end - at
        memmove(begin, at, filled)
        if progress is not None:
            progress(total)
        if n_read == 0:
            break
    if header is None:
        raise VocabularyError("the file is empty")
    return header, tuple(column[: columns.count] for column in arrays), list(empty_lines)


def _reserve(arrays, capacity):
    """Columns with this many rows, with the content of the given ones."""
    new = (
        np.empty(capacity, np.uint32),
        np.empty(capacity, np.uint8),
        np.empty((capacity, N_BYTES), np.uint8),
        np.empty(capacity, np.float64),
    )
    if arrays is not None:
        for target, source in zip(new, arrays):
            target[: len(source)] = source
    return new


def _check_stop(buffer, at, filled, line):
    """Raise when the scan stopped at something else than an incomplete line."""
    length = buffer.find(b"\n", at, filled) - at
    if length >= 0:
        raise VocabularyError(f"line {line}: {_describe_bad_line(bytes(buffer[at : at + length]))}")
    if filled - at > LONGEST_LINE:
        raise VocabularyError(f"line {line}: longer than {LONGEST_LINE} characters")


cdef char* put_integer(char* at, unsigned int value, char separator) noexcept nogil:
    at = to_chars_integer(at, at + 10, value).ptr
    at[0] = separator
    return at + 1


cdef char* put_node(
    char* at, uint32_t parent, uint8_t is_word, const uint8_t* centre, double weight
) noexcept nogil:
    cdef int i
    at = put_integer(at, parent, c" ")
    at = put_integer(at, is_word, c" ")
    for i in range(N_BYTES):
        at = put_integer(at, centre[i], c" ")
    at = write_number(at, at + 32, weight)
    at[0] = c"\n"
    return at + 1


def write_vocabulary_text(target, header, columns, progress=None):
    """Write nodes to a binary stream, weights with 17 significant digits.

    Parameters
    ----------
    target : file object
    header, columns : tuple
        As read_vocabulary_text returns them.
    progress : callable, optional
        Called with the number of nodes written so far.
    """
    cdef bytearray buffer = bytearray(BLOCK + LONGEST_LINE)
    cdef char* begin = buffer
    cdef char* at
    cdef char* limit = begin + BLOCK
    cdef uint32_t[::1] parents = columns[0]
    cdef uint8_t[::1] is_word = columns[1]
    cdef uint8_t[:, ::1] centres = columns[2]
    cdef double[::1] weights = columns[3]
    cdef size_t row = 0
    cdef size_t count = parents.shape[0]
    if not (is_word.shape[0] == centres.shape[0] == weights.shape[0] == count):
        raise VocabularyError("the columns of a node table must have the same length")
    if count > 0 and centres.shape[1] != N_BYTES:
        raise VocabularyError(f"centres must have {N_BYTES} bytes each")
    target.write(b"%d %d %d %d\n" % tuple(header))
    while row < count:
        at = begin
        with nogil:
            while row < count and at < limit:
                at = put_node(at, parents[row], is_word[row], &centres[row, 0], weights[row])
                row += 1
        target.write(memoryview(buffer)[: at - begin])
        if progress is not None:
            progress(row)
