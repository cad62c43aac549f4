// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <locale.h>
#include <stdlib.h>

#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>

namespace orbslam {

/// Numbers in text files, read and written in the C locale of POSIX and not in the user's locale.
/// For libraries whose <charconv> has no floating point yet (GCC 10).
namespace c_locale {

inline locale_t get() {
  static const locale_t locale = newlocale(LC_ALL_MASK, "C", nullptr);
  return locale;
}

/// As std::from_chars; the number must be followed by a character that cannot belong to one.
inline const char* read_number(const char* first, const char* last, double& value) {
  const char* at = first < last && *first == '-' ? first + 1 : first;
  if (at == last || *at == '-' || *at == '+' || *at == ' ' || (*at >= '\t' && *at <= '\r')) {
    return first;
  }
  if (last - at > 1 && at[0] == '0' && (at[1] == 'x' || at[1] == 'X')) {  // not as hexadecimal
    value = *first == '-' ? -0.0 : 0.0;
    return at + 1;
  }
  char* end = nullptr;
  errno = 0;
  const double number = strtod_l(first, &end, get());
  const bool out_of_range = errno == ERANGE && (std::isinf(number) || number == 0);
  if (end != first && !out_of_range) value = number;
  return end;
}

/// As std::to_chars with 17 significant digits: at most 24 characters and one more behind them.
inline char* write_number(char* first, char* last, double value) {
  const locale_t before = uselocale(get());
  const int length = std::snprintf(first, static_cast<std::size_t>(last - first), "%.17g", value);
  uselocale(before);
  return first + length;
}

}  // namespace c_locale

/// Reads a number; returns where it ends, `first` where there is none. A number that is out of
/// range does not change `value`.
inline const char* read_number(const char* first, const char* last, double& value) {
#ifdef __cpp_lib_to_chars
  return std::from_chars(first, last, value).ptr;
#else
  return c_locale::read_number(first, last, value);
#endif
}

/// Writes a number with 17 significant digits, from which it can be read back exactly; returns
/// where it ends.
inline char* write_number(char* first, char* last, double value) {
#ifdef __cpp_lib_to_chars
  return std::to_chars(first, last, value, std::chars_format::general, 17).ptr;
#else
  return c_locale::write_number(first, last, value);
#endif
}

}  // namespace orbslam
