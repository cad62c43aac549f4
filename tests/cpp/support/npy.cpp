// SPDX-License-Identifier: BSD-3-Clause
#include "support/npy.hpp"

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <numeric>
#include <regex>
#include <stdexcept>

namespace orbslam::testing {
namespace {

template <class Stored, class T>
void convert(const std::vector<char>& bytes, std::vector<T>& values) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    Stored stored;
    std::memcpy(&stored, bytes.data() + i * sizeof(Stored), sizeof(Stored));
    values[i] = static_cast<T>(stored);
  }
}

std::string text_of(const std::string& header, const char* pattern, const std::string& path) {
  std::smatch match;
  if (!std::regex_search(header, match, std::regex(pattern))) {
    throw std::runtime_error("unreadable .npy header in " + path + ": " + header);
  }
  return match[1];
}

}  // namespace

template <class T>
Array<T> read_npy(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error("cannot open " + path);
  char magic[8];
  std::uint16_t header_size = 0;
  file.read(magic, 8);
  file.read(reinterpret_cast<char*>(&header_size), 2);
  if (!file || std::memcmp(magic, "\x93NUMPY\x01\x00", 8) != 0) {
    throw std::runtime_error("not a version 1.0 .npy file: " + path);
  }
  std::string header(header_size, ' ');
  file.read(header.data(), header_size);
  if (text_of(header, "'fortran_order': *(True|False)", path) == "True") {
    throw std::runtime_error("Fortran order is not supported: " + path);
  }

  Array<T> array;
  std::string shape = text_of(header, "'shape': *\\(([^)]*)\\)", path);
  for (std::size_t begin = 0; begin < shape.size();) {
    std::size_t end = shape.find(',', begin);
    if (end == std::string::npos) end = shape.size();
    const std::string item = shape.substr(begin, end - begin);
    if (item.find_first_not_of(' ') != std::string::npos) array.shape.push_back(std::stoul(item));
    begin = end + 1;
  }
  const std::size_t count =
      std::accumulate(array.shape.begin(), array.shape.end(), std::size_t{1}, std::multiplies<>());
  const std::string type = text_of(header, "'descr': *'[<|=]?([a-z][0-9])'", path);
  const std::size_t item_size = static_cast<std::size_t>(type[1] - '0');
  std::vector<char> bytes(count * item_size);
  file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  if (!file) throw std::runtime_error("truncated .npy file: " + path);

  array.values.resize(count);
  if (type == "f4") {
    convert<float>(bytes, array.values);
  } else if (type == "f8") {
    convert<double>(bytes, array.values);
  } else if (type == "i4") {
    convert<std::int32_t>(bytes, array.values);
  } else if (type == "i8") {
    convert<std::int64_t>(bytes, array.values);
  } else if (type == "u1" || type == "b1") {
    convert<std::uint8_t>(bytes, array.values);
  } else {
    throw std::runtime_error("unsupported .npy type " + type + ": " + path);
  }
  return array;
}

template Array<float> read_npy(const std::string&);
template Array<double> read_npy(const std::string&);
template Array<std::int32_t> read_npy(const std::string&);
template Array<std::uint32_t> read_npy(const std::string&);
template Array<std::int64_t> read_npy(const std::string&);
template Array<std::uint8_t> read_npy(const std::string&);

std::string test_data(const std::string& name) {
  return std::string(ORBSLAM2PY_TEST_DATA) + "/" + name;
}

std::optional<std::string> shared_data() {
  const char* named = std::getenv("ORBSLAM2PY_SHARED");
  const std::string folder = named ? named : ORBSLAM2PY_SHARED_DEFAULT;
  if (!std::filesystem::is_directory(folder + "/data")) return std::nullopt;
  return folder + "/data";
}

}  // namespace orbslam::testing
