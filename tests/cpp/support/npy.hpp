// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace orbslam::testing {

/// A NumPy array read from a .npy file (format 1.0, C order, little endian).
template <class T>
struct Array {
  std::vector<std::size_t> shape;
  std::vector<T> values;

  std::size_t rows() const { return shape.empty() ? 1 : shape[0]; }
  std::size_t columns() const { return shape.size() < 2 ? 1 : shape[1]; }
  const T& at(std::size_t row, std::size_t column = 0) const {
    return values[row * columns() + column];
  }
};

/// Reads float32, float64, int32, int64 or uint8 files and converts the values to T.
/// Throws std::runtime_error naming the path when the file is missing or of another kind.
template <class T>
Array<T> read_npy(const std::string& path);

/// Path of a file that is part of the project: tests/data/<name>.
std::string test_data(const std::string& name);

/// Folder with the extra data (photographs, sequences), or nothing where it does not exist.
/// ORBSLAM2PY_SHARED names it; the default is ../shared seen from the checkout. Arrays of
/// golden/<name>.npz are found unpacked in tests/data/golden or skipped by the caller.
std::optional<std::string> shared_data();

}  // namespace orbslam::testing
