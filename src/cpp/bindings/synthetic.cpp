// SPDX-License-Identifier: BSD-3-Clause
#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include "bindings/arrays.hpp"
#include "bindings/bindings.hpp"
#include "synthetic/paths.hpp"
#include "synthetic/world.hpp"

namespace orbslam::bindings {
namespace {

using namespace py::literals;
using synthetic::PathOptions;
using synthetic::Rectangle;
using synthetic::RenderOptions;
using synthetic::Way;
using synthetic::World;

void bind_worlds(py::module_& module) {
  py::class_<Rectangle>(module, "Rectangle",
                        "A textured rectangle: origin + a u_axis + b v_axis, a in [0, width], b in "
                        "[0, height]; world frame, metres. Both sides are visible.")
      .def(py::init<>())
      .def_readwrite("origin", &Rectangle::origin, "Corner, (3,) float64 [m].")
      .def_readwrite("u_axis", &Rectangle::u_axis, "Unit vector, (3,) float64.")
      .def_readwrite("v_axis", &Rectangle::v_axis, "Unit vector, (3,) float64.")
      .def_readwrite("width", &Rectangle::width, "Metres along u_axis.")
      .def_readwrite("height", &Rectangle::height, "Metres along v_axis.")
      .def_readwrite("texture", &Rectangle::texture, "Seed; equal seeds look alike.")
      .def_readwrite("texture_offset", &Rectangle::texture_offset, "Metres along u_axis.")
      .def_readwrite("texture_offset_v", &Rectangle::texture_offset_v, "Metres along v_axis.")
      .def_readwrite("texture_repeat", &Rectangle::texture_repeat,
                     "Metres along u_axis after which the picture comes again; 0: never.")
      .def_readwrite("texel", &Rectangle::texel, "Metres; size of the finest detail.");

  py::class_<World>(module, "World", "Textured rectangles; immutable.")
      .def(py::init<std::vector<Rectangle>>(), "rectangles"_a,
           py::call_guard<py::gil_scoped_release>(), "Paints the pictures of all rectangles.")
      .def_property_readonly("rectangles", &World::rectangles, "Copies of the rectangles.");

  module.def("make_room", &synthetic::make_room, "size"_a, "seed"_a, "n_boxes"_a,
             py::call_guard<py::gil_scoped_release>(),
             "A closed room of the inner `size` (x, y, z) [m] centred on the origin, with boxes "
             "along its walls.");
  module.def("make_corridor", &synthetic::make_corridor, "length"_a, "breadth"_a, "width"_a,
             "height"_a, "seed"_a, "repeat"_a = 0.0, py::call_guard<py::gil_scoped_release>(),
             "A corridor around a block; its walls repeat after `repeat` metres (0: never).");
  module.def("make_figure_eight", &synthetic::make_figure_eight, "length"_a, "breadth"_a, "width"_a,
             "height"_a, "seed"_a, "repeat"_a = 0.0, py::call_guard<py::gil_scoped_release>(),
             "Two corridors around a block each, with a common middle leg along z.");
  module.def("make_street", &synthetic::make_street, "length"_a, "width"_a, "seed"_a,
             py::call_guard<py::gil_scoped_release>(),
             "A street along z, the road 1.65 m below the origin, open above.");
  module.def("make_street_lap", &synthetic::make_street_lap, "length"_a, "breadth"_a, "width"_a,
             "seed"_a, py::call_guard<py::gil_scoped_release>(),
             "Streets around a block of houses, their middle lines `length` (z) by `breadth` (x), "
             "the road 1.65 m below the origin, open above.");
  module.def("make_two_rooms", &synthetic::make_two_rooms, "size"_a, "passage"_a, "seed"_a,
             "n_boxes"_a, py::call_guard<py::gil_scoped_release>(),
             "Two rooms that look alike, joined by a passage of the given length [m].");
}

void bind_paths(py::module_& module) {
  py::class_<Way>(module, "Way", "A way along corridors or streets, by arc length [m].")
      .def(py::init<const std::vector<Eigen::Vector2d>&, double, bool>(), "corners"_a, "radius"_a,
           "closed"_a, "Through the corners (x, z) [m], rounded with arcs.")
      .def("length", &Way::length, "Metres; of one lap if closed.")
      .def(
          "T_wc",
          [](const Way& way, double distance, double lateral, double yaw, double sway,
             double stride) {
            return way.T_wc(distance, PathOptions{lateral, yaw, sway, stride}).matrix();
          },
          "distance"_a, "lateral"_a = 0.0, "yaw"_a = 0.0, "sway"_a = PathOptions{}.sway,
          "stride"_a = PathOptions{}.stride,
          "Camera to world (4, 4) after `distance` metres, `lateral` metres to the right of the "
          "way, looking `yaw` radians to its right, swaying by `sway` metres every `stride` "
          "metres.");
  module.def(
      "room_T_wc",
      [](const Eigen::Vector3d& size, double seconds, double period) {
        return synthetic::room_T_wc(size, seconds, period).matrix();
      },
      "size"_a, "seconds"_a, "period"_a = 30.0,
      "Camera to world (4, 4) of a person who looks around in a room, one turn in `period` "
      "seconds.");
  module.def("corridor_way", &synthetic::corridor_way, "length"_a, "breadth"_a, "width"_a,
             "The lap through make_corridor with the same sizes.");
  module.def("figure_eight_way", &synthetic::figure_eight_way, "length"_a, "breadth"_a, "width"_a,
             "The round through make_figure_eight; twice along the middle leg.");
  module.def("street_way", &synthetic::street_way, "length"_a, "Straight along z.");
  module.def("street_lap_way", &synthetic::street_lap_way, "length"_a, "breadth"_a, "width"_a,
             "Once around the block of make_street_lap with the same sizes.");
  module.def("two_rooms_way", &synthetic::two_rooms_way, "size"_a, "passage"_a,
             "From the first room of make_two_rooms into the second.");
}

}  // namespace

void bind_synthetic(py::module_& module) {
  bind_worlds(module);
  bind_paths(module);
  module.def(
      "render",
      [](const World& world, const Eigen::Matrix4d& T_cw, double fx, double fy, double cx,
         double cy, int width, int height, double noise, double exposure, std::uint64_t noise_seed,
         int threads) {
        RenderOptions options{fx,    fy,       cx,         cy,     {width, height},
                              noise, exposure, noise_seed, threads};
        synthetic::Rendering image;
        {
          py::gil_scoped_release release;
          image = synthetic::render(world, Pose::from_matrix(T_cw), options);
        }
        return py::make_tuple(copy_to_array<std::uint8_t>(image.grey.data, {height, width}),
                              copy_to_array<float>(image.depth.data, {height, width}));
      },
      "world"_a, "T_cw"_a, "fx"_a, "fy"_a, "cx"_a, "cy"_a, "width"_a, "height"_a, "noise"_a = 0.0,
      "exposure"_a = 1.0, "noise_seed"_a = 0, "threads"_a = 1,
      "Grey image (height, width) uint8 and depth along z (height, width) float32 [m], 0 where "
      "nothing is hit. The same bytes for any number of threads.");
}

}  // namespace orbslam::bindings
