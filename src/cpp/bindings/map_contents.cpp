// SPDX-License-Identifier: BSD-3-Clause
// A map as arrays and back: what map files keep.
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <memory>
#include <string>
#include <utility>

#include "base/errors.hpp"
#include "base/parallel.hpp"
#include "bindings/arrays.hpp"
#include "bindings/bindings.hpp"
#include "bindings/one_thread.hpp"
#include "map/contents.hpp"
#include "map/stored_map.hpp"
#include "places/keyframe_index.hpp"
#include "places/vocabulary.hpp"

namespace orbslam::bindings {
namespace {

using namespace py::literals;

/// An array that takes the items over instead of copying them.
template <class Item, class Row>
py::array_t<Item> owned(std::vector<Row>&& rows, std::vector<py::ssize_t> row_shape = {}) {
  row_shape.insert(row_shape.begin(), static_cast<py::ssize_t>(rows.size()));
  auto* const kept = new std::vector<Row>(std::move(rows));
  const py::capsule owner(kept, [](void* p) { delete static_cast<std::vector<Row>*>(p); });
  return py::array_t<Item>(row_shape, reinterpret_cast<const Item*>(kept->data()), owner);
}

py::array_t<bool> flags(std::vector<std::uint8_t>&& values) {
  return owned<bool>(std::move(values));
}

// Of a camera that CameraOptions::model describes: the number of its model (the place in
// camera_model_rows(), from 1 on) and all its parameters; 0 and zeros of a pinhole. Of a fisheye
// pair the last three are CameraOptions::right_centre; no model of such a pair has that many.
constexpr std::size_t kStoredLensSize = 16, kStoredCentre = 13;
using StoredLens = std::array<double, kStoredLensSize>;

std::int64_t model_number_of(const CameraOptions& camera) {
  return camera.model ? 1 + (&camera.model->row() - camera_model_rows().data()) : 0;
}

StoredLens stored_lens_of(const CameraOptions& camera) {
  StoredLens lens{};
  if (camera.model)
    std::copy_n(camera.model->parameters().begin(), camera.model->parameters().size(),
                lens.begin());
  if (!camera.right_centre.isZero())
    std::copy_n(camera.right_centre.data(), 3, lens.begin() + kStoredCentre);
  return lens;
}

std::shared_ptr<const CameraModel> model_of(std::int64_t number, const StoredLens& lens,
                                            ImageSize size) {
  if (number == 0) return nullptr;
  const auto& rows = camera_model_rows();
  if (number < 0 || number > static_cast<std::int64_t>(rows.size())) {
    throw py::value_error("cameras.model: there is no camera model with the number " +
                          std::to_string(number));
  }
  const CameraModelRow& row = rows[static_cast<std::size_t>(number - 1)];
  const std::size_t n = row.parameters.size();
  return std::make_shared<CameraModel>(
      row.name, std::vector<double>(lens.begin(), lens.begin() + static_cast<std::ptrdiff_t>(n)),
      size);
}

// Of a camera of a rig: the row of the rig, whether it is active, T_bc as quaternion x, y, z, w and
// translation, and CameraOptions::right_centre. Cameras of no rig have -1 and zeros.
using StoredMount = std::array<double, 12>;

struct Mounted {
  CameraContents contents;
  StoredMount mount{};
};

/// The cameras, followed by those of the rigs among them.
std::vector<Mounted> with_members(const std::vector<CameraContents>& cameras) {
  std::vector<Mounted> all;
  for (const CameraContents& camera : cameras) {
    all.push_back({camera, {}});
    all.back().mount[0] = -1;
  }
  for (std::size_t rig = 0; rig < cameras.size(); ++rig) {
    for (const RigMember& member : cameras[rig].camera.members) {
      const auto& [q, t] = std::pair(member.T_bc.rotation(), member.T_bc.translation());
      const Eigen::Vector3d& c = member.camera->options().right_centre;
      CameraContents contents = cameras[rig];
      contents.camera = member.camera->options();
      all.push_back({contents,
                     {static_cast<double>(rig), member.active ? 1.0 : 0.0, q.x(), q.y(), q.z(),
                      q.w(), t.x(), t.y(), t.z(), c.x(), c.y(), c.z()}});
    }
  }
  return all;
}

RigMember member_of(const CameraOptions& own, const StoredMount& mount) {
  CameraOptions options = own;
  options.right_centre = {mount[9], mount[10], mount[11]};
  const Eigen::Quaterniond q(mount[5], mount[2], mount[3], mount[4]);
  if (!(std::abs(q.squaredNorm() - 1) < 1e-6)) {
    throw MapFileError("the rotation of a camera of a rig is no rotation");
  }
  try {
    return {std::make_shared<Camera>(options), Pose::from_unit(q, {mount[6], mount[7], mount[8]}),
            mount[1] != 0};
  } catch (const SettingsError& error) {
    throw MapFileError(std::string("a camera of a rig is impossible: ") + error.what());
  }
}

void put_cameras(py::dict& arrays, const std::vector<CameraContents>& without_members) {
  const std::vector<Mounted> mounted = with_members(without_members);
  std::vector<CameraContents> cameras;
  std::vector<StoredMount> mounts;
  for (const Mounted& one : mounted) {
    cameras.push_back(one.contents);
    mounts.push_back(one.mount);
  }
  arrays["cameras.mount"] = owned<double>(std::move(mounts), {12});
  const auto put = [&](const char* name, auto value_of) {
    using Item = decltype(value_of(cameras.front()));
    py::array_t<Item> array(static_cast<py::ssize_t>(cameras.size()));
    std::transform(cameras.begin(), cameras.end(), array.mutable_data(), value_of);
    arrays[name] = array;
  };
  using C = CameraContents;
  put("cameras.fx", [](const C& c) { return c.camera.pinhole.fx; });
  put("cameras.fy", [](const C& c) { return c.camera.pinhole.fy; });
  put("cameras.cx", [](const C& c) { return c.camera.pinhole.cx; });
  put("cameras.cy", [](const C& c) { return c.camera.pinhole.cy; });
  std::vector<Distortion> distortion;
  for (const C& c : cameras) distortion.push_back(c.camera.distortion);
  arrays["cameras.distortion"] = owned<double>(std::move(distortion), {8});
  std::vector<StoredLens> lens;
  for (const C& c : cameras) lens.push_back(stored_lens_of(c.camera));
  arrays["cameras.lens"] = owned<double>(std::move(lens), {kStoredLensSize});
  put("cameras.model", [](const C& c) { return model_number_of(c.camera); });
  put("cameras.bf", [](const C& c) { return c.camera.bf; });
  put("cameras.depth_ratio", [](const C& c) { return c.camera.depth_ratio; });
  put("cameras.width", [](const C& c) { return std::int64_t{c.camera.image_size.width}; });
  put("cameras.height", [](const C& c) { return std::int64_t{c.camera.image_size.height}; });
  put("cameras.scale_factor", [](const C& c) { return c.scale_factor; });
  put("cameras.n_levels", [](const C& c) { return std::int64_t{c.n_levels}; });
}

void put_keyframes(py::dict& arrays, KeyFrameRows&& rows) {
  arrays["keyframes.ids"] = owned<std::int64_t>(std::move(rows.ids));
  arrays["keyframes.frame_ids"] = owned<std::int64_t>(std::move(rows.frame_ids));
  arrays["keyframes.timestamps"] = owned<double>(std::move(rows.timestamps));
  arrays["keyframes.camera"] = owned<std::int64_t>(std::move(rows.camera));
  arrays["keyframes.rotations"] = owned<double>(std::move(rows.rotations), {4});
  arrays["keyframes.translations"] = owned<double>(std::move(rows.translations), {3});
  arrays["keyframes.scale"] = owned<double>(std::move(rows.scale));
  arrays["keyframes.parent"] = owned<std::int64_t>(std::move(rows.parent));
  arrays["keyframes.provisional_parent"] = flags(std::move(rows.provisional_parent));
  arrays["keyframes.processed"] = flags(std::move(rows.processed));
}

void put_keypoints(py::dict& arrays, const std::vector<std::shared_ptr<const Frame>>& frames,
                   const std::vector<bool>& is_known) {
  std::vector<std::int64_t> offsets{0};
  std::vector<std::uint8_t> has_colours;
  bool distorts = false, has_any_colours = false, all_described = true;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const std::size_t n = is_known[i] ? 0 : frames[i]->size();
    offsets.push_back(offsets.back() + static_cast<std::int64_t>(n));
    distorts |= frames[i]->camera->distorts();
    has_colours.push_back(frames[i]->colours.empty() ? 0 : 1);
    has_any_colours |= !frames[i]->colours.empty();
    all_described &= frames[i]->described;
  }
  const auto n = static_cast<py::ssize_t>(offsets.back());
  using Shape = std::vector<py::ssize_t>;
  py::array_t<float> keypoints(Shape{n, 2}), raw(Shape{distorts ? n : 0, 2}), angle(n), response(n),
      depth(n), right_u(n);
  py::array_t<std::uint8_t> octave(n), descriptors(Shape{n, 32}),
      colours(Shape{has_any_colours ? n : 0, 3});
  py::array_t<std::uint32_t> words(all_described ? n : 0);
  const WritableKeypoints columns{keypoints.mutable_data(),
                                  distorts ? raw.mutable_data() : nullptr,
                                  octave.mutable_data(),
                                  angle.mutable_data(),
                                  response.mutable_data(),
                                  descriptors.mutable_data(),
                                  depth.mutable_data(),
                                  right_u.mutable_data(),
                                  has_any_colours ? colours.mutable_data() : nullptr,
                                  all_described ? words.mutable_data() : nullptr};
  {
    const py::gil_scoped_release release;
    for (std::size_t i = 0; i < frames.size(); ++i) {
      if (is_known[i]) continue;
      copy_keypoints(*frames[i], columns, static_cast<std::size_t>(offsets[i]));
    }
  }
  arrays["keyframes.has_colours"] = flags(std::move(has_colours));
  arrays["keyframes.offsets"] = owned<std::int64_t>(std::move(offsets));
  arrays["keyframes.keypoints"] = keypoints;
  arrays["keyframes.raw_keypoints"] = raw;
  arrays["keyframes.octave"] = octave;
  arrays["keyframes.angle"] = angle;
  arrays["keyframes.response"] = response;
  arrays["keyframes.descriptors"] = descriptors;
  arrays["keyframes.depth"] = depth;
  arrays["keyframes.right_u"] = right_u;
  arrays["keyframes.colours"] = colours;
  arrays["keyframes.words"] = words;
}

void put_the_rest(py::dict& arrays, MapContents&& contents) {
  auto& removed = contents.removed_keyframes;
  arrays["removed_keyframes.ids"] = owned<std::int64_t>(std::move(removed.ids));
  arrays["removed_keyframes.parent"] = owned<std::int64_t>(std::move(removed.parent));
  arrays["removed_keyframes.rotations"] = owned<double>(std::move(removed.rotations), {4});
  arrays["removed_keyframes.translations"] = owned<double>(std::move(removed.translations), {3});
  arrays["removed_keyframes.scale"] = owned<double>(std::move(removed.scale));
  arrays["removed_keyframes.parent_scale"] = owned<double>(std::move(removed.parent_scale));
  auto& points = contents.points;
  arrays["points.ids"] = owned<std::int64_t>(std::move(points.ids));
  arrays["points.positions"] = owned<double>(std::move(points.positions), {3});
  arrays["points.mean_directions"] = owned<double>(std::move(points.mean_directions), {3});
  arrays["points.min_distance"] = owned<double>(std::move(points.min_distance));
  arrays["points.max_distance"] = owned<double>(std::move(points.max_distance));
  arrays["points.descriptors"] = owned<std::uint8_t>(std::move(points.descriptors), {32});
  arrays["points.n_visible"] = owned<std::int32_t>(std::move(points.n_visible));
  arrays["points.n_found"] = owned<std::int32_t>(std::move(points.n_found));
  arrays["points.reference_keyframe"] = owned<std::int64_t>(std::move(points.reference_keyframe));
  arrays["points.first_keyframe"] = owned<std::int64_t>(std::move(points.first_keyframe));
  arrays["points.first_frame"] = owned<std::int64_t>(std::move(points.first_frame));
  arrays["observations.point"] = owned<std::int64_t>(std::move(contents.observations.point));
  arrays["observations.keyframe"] = owned<std::int64_t>(std::move(contents.observations.keyframe));
  arrays["observations.keypoint"] = owned<std::int32_t>(std::move(contents.observations.keypoint));
  arrays["covisibility.a"] = owned<std::int64_t>(std::move(contents.covisibility.a));
  arrays["covisibility.b"] = owned<std::int64_t>(std::move(contents.covisibility.b));
  arrays["covisibility.weight"] = owned<std::int32_t>(std::move(contents.covisibility.weight));
  arrays["loop_edges"] = owned<std::int64_t>(std::move(contents.loop_edges), {2});
}

// Numbers in a patch.
constexpr py::ssize_t kPatchValues = ReferencePatch::kSize * ReferencePatch::kSize;

void put_patches(py::dict& arrays, PatchRows&& rows) {
  const auto n = static_cast<py::ssize_t>(rows.point.size());
  using Shape = std::vector<py::ssize_t>;
  py::array_t<std::int64_t> keyframe(n);
  py::array_t<std::uint8_t> level(n);
  py::array_t<float> pixel(Shape{n, 2}), fraction(Shape{n, 2});
  py::array_t<std::uint16_t> values(Shape{n, kPatchValues});
  std::int64_t* const keyframes = keyframe.mutable_data();
  std::uint8_t* const levels = level.mutable_data();
  float *const pixels = pixel.mutable_data(), *const fractions = fraction.mutable_data();
  std::uint16_t* const numbers = values.mutable_data();
  {
    const py::gil_scoped_release release;
    for (std::size_t i = 0; i < rows.patches.size(); ++i) {
      const PointPatch& patch = *rows.patches[i];
      keyframes[i] = patch.keyframe.value;
      levels[i] = static_cast<std::uint8_t>(patch.level);
      std::copy_n(patch.pixel.data(), 2, pixels + 2 * i);
      std::copy_n(patch.patch.fraction.data(), 2, fractions + 2 * i);
      std::memcpy(numbers + kPatchValues * static_cast<py::ssize_t>(i), &patch.patch.values,
                  sizeof(patch.patch.values));
    }
  }
  arrays["patches.point"] = owned<std::int64_t>(std::move(rows.point));
  arrays["patches.keyframe"] = keyframe;
  arrays["patches.camera"] = owned<std::int64_t>(std::move(rows.camera));
  arrays["patches.level"] = level;
  arrays["patches.pixel"] = pixel;
  arrays["patches.fraction"] = fraction;
  arrays["patches.values"] = values;
}

void put_aligned(py::dict& arrays, AlignedRows&& rows, std::vector<NoiseRow>&& noise) {
  const auto& sightings = rows.sightings;
  const auto put = [&](const char* name, auto value_of) {
    using Item = decltype(value_of(sightings.front()));
    py::array_t<Item> array(static_cast<py::ssize_t>(sightings.size()));
    std::transform(sightings.begin(), sightings.end(), array.mutable_data(), value_of);
    arrays[name] = array;
  };
  using A = AlignedSighting;
  std::vector<std::array<float, 2>> positions;
  for (const A& a : sightings) positions.push_back({a.u, a.v});
  arrays["aligned.keyframe"] = owned<std::int64_t>(std::move(rows.keyframe));
  arrays["aligned.keypoint"] = owned<std::int32_t>(std::move(rows.keypoint));
  put("aligned.point", [](const A& a) { return a.point.value; });
  arrays["aligned.position"] = owned<float>(std::move(positions), {2});
  put("aligned.right_u", [](const A& a) { return a.right_u; });
  put("aligned.variance", [](const A& a) { return a.variance; });
  put("aligned.right_variance", [](const A& a) { return a.right_variance; });
  put("aligned.reference", [](const A& a) { return a.reference; });
  arrays["alignment_noise"] = owned<double>(std::move(noise), {2});
}

using ContiguousIds = py::array_t<std::int64_t, py::array::c_style>;

py::dict map_contents(const Map& map, const ContiguousIds& known, std::uint64_t keyframe_stamp,
                      std::uint64_t point_stamp, const ContiguousIds& incomplete_pages,
                      bool with_patches) {
  MapContents contents;
  const ContentsKnown before{
      keyframe_stamp,
      point_stamp,
      {incomplete_pages.data(), incomplete_pages.data() + incomplete_pages.size()}};
  std::vector<bool> is_known;
  {
    const std::vector<std::int64_t> ids(known.data(), known.data() + known.size());
    const py::gil_scoped_release release;
    contents = take_contents(map, before, with_patches);
    for (const KeyFrameId id : contents.keyframes.ids) {
      is_known.push_back(std::binary_search(ids.begin(), ids.end(), id.value));
    }
  }
  py::dict arrays;
  arrays["map_index"] = contents.epoch;
  arrays["next_keyframe"] = contents.next_keyframe.value;
  arrays["next_point"] = contents.next_point.value;
  arrays["known.keyframe_stamp"] = contents.keyframe_stamp;
  arrays["known.point_stamp"] = contents.point_stamp;
  arrays["known.changed_keyframes"] = flags(std::move(contents.keyframe_changed));
  arrays["known.pages"] = owned<std::int64_t>(std::move(contents.pages));
  arrays["known.incomplete_pages"] = owned<std::int64_t>(std::move(contents.incomplete_pages));
  put_cameras(arrays, contents.cameras);
  put_keyframes(arrays, std::move(contents.keyframes));
  put_keypoints(arrays, contents.frames, is_known);
  put_patches(arrays, std::move(contents.patches));
  put_aligned(arrays, std::move(contents.aligned), std::move(contents.noise));
  put_the_rest(arrays, std::move(contents));
  return arrays;
}

/// Takes arrays out of a dictionary, checks type and shape, and keeps them alive.
class Arrays {
 public:
  explicit Arrays(py::dict arrays) : arrays_(std::move(arrays)) {}

  /// (n, Width) items, or (n,) when Width is 0; n is any number if `count` is negative.
  template <class Item, py::ssize_t Width = 0>
  const Item* items(const char* name, py::ssize_t& count) {
    if (!arrays_.contains(name)) throw MapFileError(std::string(name) + " is missing");
    const auto array = py::array::ensure(arrays_[name]);
    const bool fits = array && py::isinstance<py::array_t<Item>>(array) &&
                      array.ndim() == (Width ? 2 : 1) && (!Width || array.shape(1) == Width) &&
                      (count < 0 || array.shape(0) == count);
    if (!fits) throw MapFileError(std::string(name) + " has the wrong type or length");
    kept_.push_back(py::array_t<Item, py::array::c_style>::ensure(array));
    count = array.shape(0);
    return static_cast<const Item*>(kept_.back().data());
  }
  template <class Row, class Item = Row, py::ssize_t Width = 0>
  Column<Row> column(const char* name, py::ssize_t& count) {
    const Item* const data = items<Item, Width>(name, count);
    return {reinterpret_cast<const Row*>(data), static_cast<std::size_t>(count)};
  }
  Column<std::uint8_t> flags(const char* name, py::ssize_t& count) {
    return column<std::uint8_t, bool>(name, count);
  }
  std::int64_t number(const char* name) const { return arrays_[name].cast<std::int64_t>(); }

 private:
  py::dict arrays_;
  std::vector<py::array> kept_;
};

void read_cameras(Arrays& arrays, StoredMap& stored) {
  py::ssize_t n = -1;
  const auto fx = arrays.column<double>("cameras.fx", n),
             fy = arrays.column<double>("cameras.fy", n),
             cx = arrays.column<double>("cameras.cx", n),
             cy = arrays.column<double>("cameras.cy", n),
             bf = arrays.column<double>("cameras.bf", n),
             ratio = arrays.column<double>("cameras.depth_ratio", n);
  const auto distortion = arrays.column<Distortion, double, 8>("cameras.distortion", n);
  const auto lens = arrays.column<StoredLens, double, kStoredLensSize>("cameras.lens", n);
  const auto model = arrays.column<std::int64_t>("cameras.model", n);
  const auto width = arrays.column<std::int64_t>("cameras.width", n),
             height = arrays.column<std::int64_t>("cameras.height", n),
             levels = arrays.column<std::int64_t>("cameras.n_levels", n);
  const auto factor = arrays.column<float>("cameras.scale_factor", n);
  const auto mount = arrays.column<StoredMount, double, 12>("cameras.mount", n);
  const auto small = [](std::int64_t value) {  // out of range stays out of range
    return static_cast<int>(std::clamp<std::int64_t>(value, -1, 1 << 20));
  };
  for (std::size_t i = 0; i < fx.size; ++i) {
    CameraOptions camera;
    camera.pinhole = {fx[i], fy[i], cx[i], cy[i]};
    camera.distortion = distortion[i];
    camera.bf = bf[i];
    camera.depth_ratio = ratio[i];
    camera.image_size = {small(width[i]), small(height[i])};
    camera.model = model_of(model[i], lens[i], camera.image_size);
    if (camera.model && camera.model->parameters().size() <= kStoredCentre) {
      std::copy_n(lens[i].begin() + kStoredCentre, 3, camera.right_centre.data());
    }
    if (mount[i][0] >= 0) {
      if (!(mount[i][0] < static_cast<double>(stored.cameras.size()))) {
        throw MapFileError("a camera belongs to a rig that is missing");
      }
      auto& rig = stored.cameras[static_cast<std::size_t>(mount[i][0])].camera;
      rig.members.push_back(member_of(camera, mount[i]));
      continue;
    }
    if (i > stored.cameras.size()) {
      throw MapFileError("the cameras of rigs must follow all others");
    }
    stored.cameras.push_back({camera, factor[i], small(levels[i])});
  }
}

void read_keyframes(Arrays& arrays, StoredMap& stored) {
  py::ssize_t k = -1;
  auto& rows = stored.keyframes;
  rows.ids = arrays.column<std::int64_t>("keyframes.ids", k);
  rows.frame_ids = arrays.column<std::int64_t>("keyframes.frame_ids", k);
  rows.timestamps = arrays.column<double>("keyframes.timestamps", k);
  rows.camera = arrays.column<std::int64_t>("keyframes.camera", k);
  rows.rotations = arrays.column<Quaternion, double, 4>("keyframes.rotations", k);
  rows.translations = arrays.column<Vector3, double, 3>("keyframes.translations", k);
  rows.scale = arrays.column<double>("keyframes.scale", k);
  rows.parent = arrays.column<std::int64_t>("keyframes.parent", k);
  rows.provisional_parent = arrays.flags("keyframes.provisional_parent", k);
  rows.processed = arrays.flags("keyframes.processed", k);
  rows.has_colours = arrays.flags("keyframes.has_colours", k);
  py::ssize_t ends = k + 1;
  rows.offsets = arrays.column<std::int64_t>("keyframes.offsets", ends);
}

/// The keypoints of some keyframes; n in number, or any if n is negative, and then told.
ReadableKeypoints read_keypoints(Arrays& arrays, py::ssize_t& n) {
  py::ssize_t n_raw = -1, n_colours = -1, n_words = -1;
  ReadableKeypoints columns;
  columns.keypoints = arrays.items<float, 2>("keyframes.keypoints", n);
  columns.octave = arrays.items<std::uint8_t>("keyframes.octave", n);
  columns.angle = arrays.items<float>("keyframes.angle", n);
  columns.response = arrays.items<float>("keyframes.response", n);
  columns.descriptors = arrays.items<std::uint8_t, 32>("keyframes.descriptors", n);
  columns.depth = arrays.items<float>("keyframes.depth", n);
  columns.right_u = arrays.items<float>("keyframes.right_u", n);
  const float* const raw = arrays.items<float, 2>("keyframes.raw_keypoints", n_raw);
  const std::uint8_t* const colours = arrays.items<std::uint8_t, 3>("keyframes.colours", n_colours);
  const auto* const words = arrays.items<std::uint32_t>("keyframes.words", n_words);
  for (const py::ssize_t optional : {n_raw, n_colours, n_words}) {
    if (optional != 0 && optional != n) {
      throw MapFileError("raw keypoints, colours or words are not as many as keypoints");
    }
  }
  if (n_raw == n && n > 0) columns.raw_keypoints = raw;
  if (n_colours == n && n > 0) columns.colours = colours;
  if (n_words == n && n > 0) columns.words = words;
  return columns;
}

void read_the_rest(Arrays& arrays, StoredMap& stored) {
  py::ssize_t r = -1, p = -1, o = -1, e = -1, l = -1;
  auto& removed = stored.removed_keyframes;
  removed.ids = arrays.column<std::int64_t>("removed_keyframes.ids", r);
  removed.parent = arrays.column<std::int64_t>("removed_keyframes.parent", r);
  removed.rotations = arrays.column<Quaternion, double, 4>("removed_keyframes.rotations", r);
  removed.translations = arrays.column<Vector3, double, 3>("removed_keyframes.translations", r);
  removed.scale = arrays.column<double>("removed_keyframes.scale", r);
  removed.parent_scale = arrays.column<double>("removed_keyframes.parent_scale", r);
  auto& points = stored.points;
  points.ids = arrays.column<std::int64_t>("points.ids", p);
  points.positions = arrays.column<Vector3, double, 3>("points.positions", p);
  points.mean_directions = arrays.column<Vector3, double, 3>("points.mean_directions", p);
  points.min_distance = arrays.column<double>("points.min_distance", p);
  points.max_distance = arrays.column<double>("points.max_distance", p);
  points.descriptors = arrays.items<std::uint8_t, 32>("points.descriptors", p);
  points.n_visible = arrays.column<std::int32_t>("points.n_visible", p);
  points.n_found = arrays.column<std::int32_t>("points.n_found", p);
  points.reference_keyframe = arrays.column<std::int64_t>("points.reference_keyframe", p);
  points.first_keyframe = arrays.column<std::int64_t>("points.first_keyframe", p);
  points.first_frame = arrays.column<std::int64_t>("points.first_frame", p);
  stored.observations.point = arrays.column<std::int64_t>("observations.point", o);
  stored.observations.keyframe = arrays.column<std::int64_t>("observations.keyframe", o);
  stored.observations.keypoint = arrays.column<std::int32_t>("observations.keypoint", o);
  stored.covisibility.a = arrays.column<std::int64_t>("covisibility.a", e);
  stored.covisibility.b = arrays.column<std::int64_t>("covisibility.b", e);
  stored.covisibility.weight = arrays.column<std::int32_t>("covisibility.weight", e);
  stored.loop_edges = arrays.column<std::array<std::int64_t, 2>, std::int64_t, 2>("loop_edges", l);
}

void read_patches(Arrays& arrays, StoredMap& stored) {
  py::ssize_t q = -1, a = -1, n = -1;
  auto& patches = stored.patches;
  using Two = std::array<float, 2>;
  patches.point = arrays.column<std::int64_t>("patches.point", q);
  patches.keyframe = arrays.column<std::int64_t>("patches.keyframe", q);
  patches.camera = arrays.column<std::int64_t>("patches.camera", q);
  patches.level = arrays.column<std::uint8_t>("patches.level", q);
  patches.pixel = arrays.column<Two, float, 2>("patches.pixel", q);
  patches.fraction = arrays.column<Two, float, 2>("patches.fraction", q);
  patches.values = arrays.items<std::uint16_t, kPatchValues>("patches.values", q);
  auto& aligned = stored.aligned;
  aligned.keyframe = arrays.column<std::int64_t>("aligned.keyframe", a);
  aligned.keypoint = arrays.column<std::int32_t>("aligned.keypoint", a);
  aligned.point = arrays.column<std::int64_t>("aligned.point", a);
  aligned.position = arrays.column<Two, float, 2>("aligned.position", a);
  aligned.right_u = arrays.column<float>("aligned.right_u", a);
  aligned.variance = arrays.column<float>("aligned.variance", a);
  aligned.right_variance = arrays.column<float>("aligned.right_variance", a);
  aligned.reference = arrays.flags("aligned.reference", a);
  stored.noise = arrays.column<NoiseRow, double, 2>("alignment_noise", n);
}

/// All but the keypoints.
StoredMap read_stored(Arrays& arrays) {
  StoredMap stored;
  stored.next_keyframe = arrays.number("next_keyframe");
  stored.next_point = arrays.number("next_point");
  read_cameras(arrays, stored);
  read_keyframes(arrays, stored);
  read_the_rest(arrays, stored);
  read_patches(arrays, stored);
  return stored;
}

void check(const py::dict& contents) {
  Arrays arrays(contents);
  StoredMap stored = read_stored(arrays);
  py::ssize_t n = -1;
  const StoredKeypoints keypoints{0, stored.keyframes.ids.size, read_keypoints(arrays, n)};
  stored.n_keypoints = static_cast<std::size_t>(n);
  const py::gil_scoped_release release;
  check_stored_map(stored);
  check_stored_keypoints(stored, keypoints);
}

/// Makes a map of its contents, of which the keypoints come in parts.
class MapRestorer {
 public:
  MapRestorer(const py::dict& contents, std::int64_t n_keypoints,
              std::shared_ptr<const Vocabulary> vocabulary, bool words_fit)
      : arrays_(contents),
        stored_(read_stored(arrays_)),
        vocabulary_(std::move(vocabulary)),
        words_fit_(words_fit) {
    stored_.n_keypoints = static_cast<std::size_t>(n_keypoints);
    const py::gil_scoped_release release;
    check_stored_map(stored_);
    cameras_ = restore_cameras(stored_);
    scales_ = restore_scales(stored_);
    frames_.reserve(stored_.keyframes.ids.size);
  }

  void add(const py::dict& part, std::size_t n_keyframes) {
    const OneThread::Use use(one_thread_, kRefusal);
    if (n_keyframes > stored_.keyframes.ids.size - frames_.size()) {
      throw MapFileError("there are keypoints of more keyframes than there are");
    }
    const std::size_t first = frames_.size(), end = first + n_keyframes;
    const auto& offsets = stored_.keyframes.offsets;
    Arrays arrays(part);
    auto n = static_cast<py::ssize_t>(offsets[end] - offsets[first]);
    const StoredKeypoints keypoints{first, end, read_keypoints(arrays, n)};
    const std::size_t n_threads = threads_for(n_keyframes);
    const py::gil_scoped_release release;
    check_stored_keypoints(stored_, keypoints);
    frames_.resize(end);
    try {
      for_each_in_parallel(n_keyframes, n_threads,
                           [&](std::size_t i) { make_frame(keypoints, first + i); });
    } catch (...) {
      frames_.resize(first);
      throw;
    }
  }

  void finish(Map& map, KeyFrameIndex* index) {
    const OneThread::Use use(one_thread_, kRefusal);
    const py::gil_scoped_release release;
    if (frames_.size() != stored_.keyframes.ids.size) {
      throw MapFileError("the keypoints of some keyframes are missing");
    }
    restore_map(map, stored_, frames_);
    if (!index) return;
    for (std::size_t i = 0; i < frames_.size(); ++i) {
      index->add(KeyFrameId(stored_.keyframes.ids[i]), frames_[i]);
    }
  }

 private:
  static constexpr const char* kRefusal = "this map is being restored in another thread";

  void make_frame(const StoredKeypoints& keypoints, std::size_t row) {
    const std::shared_ptr<Frame> frame = restore_frame(stored_, keypoints, row, cameras_, scales_);
    if (vocabulary_ && words_fit_ && keypoints.columns.words) {
      const auto& offsets = stored_.keyframes.offsets;
      const auto begin = offsets[row] - offsets[keypoints.first_row];
      try {
        describe(*frame, *vocabulary_, keypoints.columns.words + begin);
      } catch (const VocabularyError&) {
        throw MapFileError("keyframe " + std::to_string(stored_.keyframes.ids[row]) +
                           " has a word that the vocabulary does not have");
      }
    } else if (vocabulary_) {
      describe(*frame, *vocabulary_);
    }
    frames_[row] = frame;
  }

  OneThread one_thread_;
  Arrays arrays_;
  StoredMap stored_;
  std::shared_ptr<const Vocabulary> vocabulary_;
  bool words_fit_;
  std::vector<std::shared_ptr<const Camera>> cameras_;
  std::vector<std::shared_ptr<const ScalePyramid>> scales_;
  std::vector<std::shared_ptr<const Frame>> frames_;
};

}  // namespace

void bind_map_contents(py::module_& module) {
  module.def("map_contents", &map_contents, "map"_a,
             "known"_a = py::array_t<std::int64_t>(py::ssize_t{0}), "keyframe_stamp"_a = 0,
             "point_stamp"_a = 0, "incomplete_pages"_a = py::array_t<std::int64_t>(py::ssize_t{0}),
             "with_patches"_a = true,
             "The complete contents of a map at one moment, as arrays by name: see\n"
             "orbslam2py.maps.MapContents. The keypoints of the keyframes `known` ((m,) int64\n"
             "ascending), which never change, are left out. With the stamps and incomplete pages\n"
             "of an earlier call, points and their patches come only of pages that may have\n"
             "changed since, and aligned sightings of keyframes that may have. Without patches\n"
             "there are no aligned sightings either.");
  module.def("check_map_contents", &check, "contents"_a,
             "Raises MapFileError, naming the thing, unless a map can be made of them.");
  py::class_<MapRestorer>(
      module, "MapRestorer",
      "Makes a map of contents as of map_contents(), of which the keypoints may "
      "come in parts. Raises MapFileError, naming the thing, before anything "
      "was changed.")
      .def(py::init([](const py::dict& contents, std::int64_t n_keypoints,
                       std::shared_ptr<Vocabulary> vocabulary, bool words_fit) {
             return std::make_unique<MapRestorer>(contents, n_keypoints, std::move(vocabulary),
                                                  words_fit);
           }),
           "contents"_a, "n_keypoints"_a, "vocabulary"_a = nullptr, "words_fit"_a = false,
           "Contents without the keypoints, which need most of the memory. With a vocabulary "
           "keyframes are\n"
           "described by words: by those given with the keypoints if they are of this one.")
      .def("add", &MapRestorer::add, "keypoints"_a, "n_keyframes"_a,
           "The arrays of the keypoints of so many more keyframes; they are copied.")
      .def("finish", &MapRestorer::finish, "map"_a, "index"_a = nullptr,
           "Fill an empty map; keyframes are added to the index if there is one.");
}

}  // namespace orbslam::bindings
