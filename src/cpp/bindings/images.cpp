// SPDX-License-Identifier: BSD-3-Clause
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <string_view>

#include "bindings/bindings.hpp"
#include "images/png.hpp"

namespace orbslam::bindings {
namespace {

namespace py = pybind11;

py::object decoded_png(const py::bytes& content) {
  const std::string_view bytes(content);
  const FileContent view{reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()};
  std::optional<PngFile> file;
  {
    const py::gil_scoped_release release;
    file = open_png(view);
  }
  if (!file) return py::none();
  const PngKind& kind = file->kind;
  std::vector<py::ssize_t> shape{kind.height, kind.width};
  if (kind.channels > 1) shape.push_back(kind.channels);
  py::array image(kind.bits == 16 ? py::dtype::of<std::uint16_t>() : py::dtype::of<std::uint8_t>(),
                  std::move(shape));
  auto* pixels = static_cast<std::uint8_t*>(image.mutable_data());
  bool whole = false;
  {
    const py::gil_scoped_release release;
    whole = decode_png(*file, pixels);
  }
  return whole ? py::object(std::move(image)) : py::none();
}

}  // namespace

void bind_images(py::module_& module) {
  module.def(
      "decode_png", &decoded_png, py::arg("content"),
      "Decode the content of a PNG file of a plain kind.\n\n"
      "Returns (h, w) grey, (h, w, 3) BGR or (h, w, 4) BGRA, uint8 or uint16, as OpenCV does;\n"
      "None for a file of another kind (palette, interlaced, 1 to 4 bits, several images), a\n"
      "broken one, or no PNG file at all. docs/decisions.md, 51.");
}

}  // namespace orbslam::bindings
