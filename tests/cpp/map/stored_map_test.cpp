// SPDX-License-Identifier: BSD-3-Clause
#include "map/stored_map.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <random>

#include "base/errors.hpp"
#include "map/content_hash.hpp"
#include "map_builder.hpp"
#include "random_operations.hpp"

namespace orbslam::testing {
namespace {

/// The arrays of a map, as a file would hold them; tests spoil them.
class WrittenMap {
 public:
  explicit WrittenMap(const Map& map) {
    MapContents contents = take_contents(map);
    stored.next_keyframe = contents.next_keyframe.value;
    stored.next_point = contents.next_point.value;
    stored.cameras = contents.cameras;
    write_keyframes(contents);
    write_keypoints(contents.frames);
    auto& removed = contents.removed_keyframes;
    put(stored.removed_keyframes.ids, removed.ids);
    put(stored.removed_keyframes.parent, removed.parent);
    put(stored.removed_keyframes.rotations, removed.rotations);
    put(stored.removed_keyframes.translations, removed.translations);
    put(stored.removed_keyframes.scale, removed.scale);
    put(stored.removed_keyframes.parent_scale, removed.parent_scale);
    write_points(contents.points);
    put(stored.observations.point, contents.observations.point);
    put(stored.observations.keyframe, contents.observations.keyframe);
    put(stored.observations.keypoint, contents.observations.keypoint);
    put(stored.covisibility.a, contents.covisibility.a);
    put(stored.covisibility.b, contents.covisibility.b);
    put(stored.covisibility.weight, contents.covisibility.weight);
    put(stored.loop_edges, contents.loop_edges);
    write_patches(contents.patches);
    write_aligned(contents.aligned);
    put(stored.noise, contents.noise);
  }

  /// Fills a map with it, after all checks.
  void restore(Map& map) const {
    check_stored_map(stored);
    const auto cameras = restore_cameras(stored);
    const auto scales = restore_scales(stored);
    std::vector<std::shared_ptr<const Frame>> frames;
    const std::size_t n = stored.keyframes.ids.size;
    for (std::size_t first = 0; first < n; first += kPart) {
      const StoredKeypoints part = keypoints(first, std::min(n, first + kPart));
      check_stored_keypoints(stored, part);
      for (std::size_t i = part.first_row; i < part.end_row; ++i) {
        frames.push_back(restore_frame(stored, part, i, cameras, scales));
      }
    }
    restore_map(map, stored, frames);
  }

  /// Those of some keyframes of a map whose offsets were found good.
  StoredKeypoints keypoints(std::size_t first_row, std::size_t end_row) const {
    const auto k = static_cast<std::size_t>(stored.keyframes.offsets[first_row]);
    ReadableKeypoints columns = keypoints_;
    columns.keypoints += 2 * k;
    columns.octave += k;
    columns.angle += k;
    columns.response += k;
    columns.descriptors += 32 * k;
    columns.depth += k;
    columns.right_u += k;
    return {first_row, end_row, columns};
  }

  std::size_t n_arrays() const { return arrays_.size(); }
  std::vector<std::uint8_t>& array(std::size_t i) { return *arrays_[i]; }

  StoredMap stored;

 private:
  template <class To, class Row>
  const To* keep(const std::vector<Row>& rows) {
    arrays_.push_back(std::make_unique<std::vector<std::uint8_t>>(sizeof(Row) * rows.size()));
    if (!rows.empty()) std::memcpy(arrays_.back()->data(), rows.data(), arrays_.back()->size());
    return reinterpret_cast<const To*>(arrays_.back()->data());
  }
  template <class To, class Row>
  void put(Column<To>& column, const std::vector<Row>& rows) {
    static_assert(sizeof(To) == sizeof(Row));
    column = {keep<To>(rows), rows.size()};
  }

  void write_keyframes(const MapContents& contents) {
    const KeyFrameRows& rows = contents.keyframes;
    auto& columns = stored.keyframes;
    put(columns.ids, rows.ids);
    put(columns.frame_ids, rows.frame_ids);
    put(columns.timestamps, rows.timestamps);
    put(columns.camera, rows.camera);
    put(columns.rotations, rows.rotations);
    put(columns.translations, rows.translations);
    put(columns.scale, rows.scale);
    put(columns.parent, rows.parent);
    put(columns.provisional_parent, rows.provisional_parent);
    put(columns.processed, rows.processed);
    put(columns.has_colours, std::vector<std::uint8_t>(rows.ids.size(), 0));
    std::vector<std::int64_t> offsets{0};
    for (const auto& frame : contents.frames) {
      offsets.push_back(offsets.back() + static_cast<std::int64_t>(frame->size()));
    }
    put(columns.offsets, offsets);
    stored.n_keypoints = static_cast<std::size_t>(offsets.back());
  }

  void write_keypoints(const std::vector<std::shared_ptr<const Frame>>& frames) {
    const std::size_t n = stored.n_keypoints;
    std::vector<float> keypoints(2 * n), angle(n), response(n), depth(n), right_u(n);
    std::vector<std::uint8_t> octave(n), descriptors(32 * n);
    const WritableKeypoints columns{
        keypoints.data(),   nullptr,      octave.data(),  angle.data(), response.data(),
        descriptors.data(), depth.data(), right_u.data(), nullptr,      nullptr};
    std::size_t first = 0;
    for (const auto& frame : frames) {
      copy_keypoints(*frame, columns, first);
      first += frame->size();
    }
    keypoints_ = {keep<float>(keypoints),
                  nullptr,
                  keep<std::uint8_t>(octave),
                  keep<float>(angle),
                  keep<float>(response),
                  keep<std::uint8_t>(descriptors),
                  keep<float>(depth),
                  keep<float>(right_u),
                  nullptr,
                  nullptr};
  }

  void write_points(const PointRows& rows) {
    auto& columns = stored.points;
    put(columns.ids, rows.ids);
    put(columns.positions, rows.positions);
    put(columns.mean_directions, rows.mean_directions);
    put(columns.min_distance, rows.min_distance);
    put(columns.max_distance, rows.max_distance);
    columns.descriptors = keep<std::uint8_t>(rows.descriptors);
    put(columns.n_visible, rows.n_visible);
    put(columns.n_found, rows.n_found);
    put(columns.reference_keyframe, rows.reference_keyframe);
    put(columns.first_keyframe, rows.first_keyframe);
    put(columns.first_frame, rows.first_frame);
  }

  void write_patches(const PatchRows& rows) {
    using Two = std::array<float, 2>;
    std::vector<std::int64_t> keyframe;
    std::vector<std::uint8_t> level;
    std::vector<Two> pixel, fraction;
    std::vector<decltype(ReferencePatch::values)> values;
    for (const auto& patch : rows.patches) {
      keyframe.push_back(patch->keyframe.value);
      level.push_back(static_cast<std::uint8_t>(patch->level));
      pixel.push_back({patch->pixel.x(), patch->pixel.y()});
      fraction.push_back({patch->patch.fraction.x(), patch->patch.fraction.y()});
      values.push_back(patch->patch.values);
    }
    auto& columns = stored.patches;
    put(columns.point, rows.point);
    put(columns.keyframe, keyframe);
    put(columns.camera, rows.camera);
    put(columns.level, level);
    put(columns.pixel, pixel);
    put(columns.fraction, fraction);
    columns.values = keep<std::uint16_t>(values);
  }

  void write_aligned(const AlignedRows& rows) {
    std::vector<std::int64_t> point;
    std::vector<std::array<float, 2>> position;
    std::vector<float> right_u, variance, right_variance;
    std::vector<std::uint8_t> reference;
    for (const AlignedSighting& sighting : rows.sightings) {
      point.push_back(sighting.point.value);
      position.push_back({sighting.u, sighting.v});
      right_u.push_back(sighting.right_u);
      variance.push_back(sighting.variance);
      right_variance.push_back(sighting.right_variance);
      reference.push_back(sighting.reference ? 1 : 0);
    }
    auto& columns = stored.aligned;
    put(columns.keyframe, rows.keyframe);
    put(columns.keypoint, rows.keypoint);
    put(columns.point, point);
    put(columns.position, position);
    put(columns.right_u, right_u);
    put(columns.variance, variance);
    put(columns.right_variance, right_variance);
    put(columns.reference, reference);
  }

  static constexpr std::size_t kPart = 2;  ///< keyframes whose keypoints come at once

  ReadableKeypoints keypoints_;
  std::vector<std::unique_ptr<std::vector<std::uint8_t>>> arrays_;
};

std::string violations(const Map& map) {
  std::string text;
  for (const std::string& violation : check_invariants(map, false)) text += violation + "\n";
  return text;
}

struct MapWithLoop : MapBuilder {
  MapWithLoop() {
    for (int i = 0; i < 4; ++i) add_keyframe(true, 60);
    add_points(20, kfs({0, 1, 2}));
    add_points(16, kfs({1, 2, 3}));
    for (int i = 1; i < 4; ++i) map.update_connections(kf(i));
    map.add_loop_edge(kf(0), kf(3));
    erase_keyframe(kf(2));
  }
};

/// Points 36 to 39 are seen by all three keyframes that live.
struct MapWithPatches : MapWithLoop {
  MapWithPatches() {
    add_points(4, kfs({0, 1, 3}));
    add_patch(kPoint, kf(1));
    add_patch(kOfCulled, kf(2));
    align(kf(0), kPoint, 0.25F);
    align(kf(1), kPoint, 0);  // in vain
    align(kf(0), kOfCulled, 0.5F);
    align(kf(0), kBare, 0.5F);  // to a patch that is gone
    map.noise().position.restore(0.25, 7);
  }

  static constexpr MapPointId kPoint{36}, kOfCulled{37}, kBare{38};

  std::size_t slot_of(KeyFrameId keyframe, MapPointId point) const {
    return map.find(point)->observation_of(keyframe)->index;
  }
  void add_patch(MapPointId point, KeyFrameId keyframe) {
    auto patch = std::make_shared<PointPatch>();
    for (auto& row : patch->patch.values) row.fill(static_cast<std::uint16_t>(point.value));
    patch->patch.fraction = {0.25F, -0.5F};
    patch->keyframe = keyframe;
    patch->camera = map.find(kf(0))->frame->camera;
    patch->scales = map.find(kf(0))->frame->scales;
    patch->level = 1;
    patch->pixel = {12.5F, 13.5F};
    map.set_patch(point, std::move(patch));
  }
  void align(KeyFrameId keyframe, MapPointId point, float variance) {
    AlignedSighting sighting;
    sighting.point = point;
    sighting.u = 1.5F;
    sighting.v = 2.5F;
    sighting.right_u = 3.5F;
    sighting.variance = variance;
    sighting.right_variance = 0.125F;
    sighting.reference = point == kPoint;
    map.set_aligned(keyframe, slot_of(keyframe, point), sighting);
  }
};

TEST(StoredMap, ComesBackBitByBit) {
  MapWithLoop small;
  Map restored;
  WrittenMap(small.map).restore(restored);
  EXPECT_EQ(violations(restored), "");
  EXPECT_EQ(content_hash(restored), content_hash(small.map));
  EXPECT_EQ(restored.weight(kf(1), kf(3)), small.map.weight(kf(1), kf(3)));
  EXPECT_EQ(restored.keyframe_ids(), kfs({0, 1, 3}));
  EXPECT_TRUE(restored.scaled_pose(kf(2)).T_cw.matrix() ==
              small.map.scaled_pose(kf(2)).T_cw.matrix());
  EXPECT_FALSE(restored.erase_keyframe(kf(3))) << "a loop edge protects it";
}

TEST(StoredMap, HasPatchesAndAlignedSightings) {
  using M = MapWithPatches;
  M small;
  Map restored;
  WrittenMap(small.map).restore(restored);
  for (const MapPointId point : {M::kPoint, M::kOfCulled}) {
    ASSERT_NE(restored.find(point)->patch, nullptr);
    const PointPatch& patch = *restored.find(point)->patch;
    const PointPatch& was = *small.map.find(point)->patch;
    EXPECT_EQ(patch.patch.values, was.patch.values);
    EXPECT_EQ(patch.patch.fraction, was.patch.fraction);
    EXPECT_EQ(patch.pixel, was.pixel);
    EXPECT_EQ(patch.keyframe, was.keyframe);
    EXPECT_EQ(patch.level, 1);
    EXPECT_EQ(patch.camera, restored.find(kf(0))->frame->camera) << "one for all of them";
  }
  const auto aligned_at = [&](KeyFrameId keyframe, MapPointId point) {
    return restored.find(keyframe)->aligned_at(small.slot_of(keyframe, point), point);
  };
  const AlignedSighting* aligned = aligned_at(kf(0), M::kPoint);
  ASSERT_NE(aligned, nullptr);
  EXPECT_EQ(aligned->u, 1.5F);
  EXPECT_EQ(aligned->right_u, 3.5F);
  EXPECT_EQ(aligned->variance, 0.25F);
  EXPECT_EQ(aligned->right_variance, 0.125F);
  EXPECT_TRUE(aligned->reference);
  EXPECT_NE(aligned_at(kf(0), M::kOfCulled), nullptr);
  EXPECT_EQ(aligned_at(kf(0), M::kBare), nullptr);
  const AlignedSighting& in_vain = restored.find(kf(1))->aligned[small.slot_of(kf(1), M::kPoint)];
  EXPECT_EQ(in_vain.point, M::kPoint) << "it is not tried again";
  EXPECT_FALSE(in_vain.ok());
  EXPECT_EQ(restored.noise().position.value(), 0.25);
  EXPECT_EQ(restored.noise().position.n_measured(), 7);
  const MapContents without = take_contents(restored, {}, false);
  EXPECT_TRUE(without.patches.point.empty() && without.aligned.keyframe.empty());
  EXPECT_TRUE(without.noise.empty());
}

TEST(StoredMap, OnlyChangedAlignmentsAreCopiedAgain) {
  using M = MapWithPatches;
  M small;
  const MapContents all = take_contents(small.map);
  EXPECT_EQ(all.aligned.keyframe, (std::vector<KeyFrameId>{kf(0), kf(0), kf(1)}));
  const ContentsKnown known{all.keyframe_stamp, all.point_stamp, all.incomplete_pages};
  const MapContents none = take_contents(small.map, known);
  EXPECT_TRUE(none.aligned.keyframe.empty() && none.patches.point.empty());
  small.map.clear_aligned(kf(1), small.slot_of(kf(1), M::kPoint));
  EXPECT_EQ(take_contents(small.map, known).aligned.keyframe, (std::vector<KeyFrameId>{kf(1)}));
  small.add_patch(M::kBare, kf(1));
  EXPECT_EQ(take_contents(small.map, known).patches.point.size(), 3U);
}

TEST(StoredMap, IdsGoOnWhereTheyEnded) {
  MapWithLoop small;
  Map restored;
  WrittenMap(small.map).restore(restored);
  EXPECT_EQ(restored.add_keyframe(small.map.find(kf(0))->frame, Pose()), kf(4));
  EXPECT_EQ(restored.add_point({0, 0, 1}, kf(0), 0), MapPointId(36));
}

TEST(StoredMap, GoesIntoAnEmptyMapOnly) {
  MapWithLoop small;
  EXPECT_THROW(WrittenMap(small.map).restore(small.map), StateError);
}

TEST(StoredMap, UnprocessedKeyframesAndWhatOnlyTheySeeAreLeftOut) {
  MapWithLoop small;
  const KeyFrameId late = small.add_keyframe(false);
  small.add_point({late});
  const auto shared = small.add_point({kf(0), late});
  const MapContents contents = take_contents(small.map);
  EXPECT_EQ(contents.keyframes.ids, kfs({0, 1, 3}));
  EXPECT_EQ(contents.points.ids.back(), shared);
  EXPECT_EQ(contents.observations.keyframe.back(), kf(0));
  EXPECT_EQ(contents.incomplete_pages, (std::vector<std::int64_t>{0}));
  Map restored;
  WrittenMap(small.map).restore(restored);
  EXPECT_EQ(violations(restored), "");
}

TEST(StoredMap, WhateverWasDoneToAMapItComesBack) {
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    RandomOperations operations(seed);
    for (int i = 0; i < 400; ++i) operations.perform();
    const WrittenMap written(operations.map());
    const auto& ids = written.stored.keyframes.ids;
    if (ids.size == 0 || ids[0] != 0) continue;  // keyframe 0 waits for mapping
    Map restored;
    ASSERT_NO_THROW(written.restore(restored)) << "seed " << seed;
    EXPECT_EQ(violations(restored), "") << "seed " << seed;
  }
}

/// Numbers in a file are never trusted: every spoilt map is refused or is a sound one. The
/// sanitizers watch what happens on the way.
TEST(StoredMap, SpoiltOnesAreRefusedOrSound) {
  const MapWithPatches small;
  std::mt19937_64 random(7);
  const auto below = [&](std::size_t n) { return static_cast<std::size_t>(random() % n); };
  int n_refused = 0, n_restored = 0;
  for (int run = 0; run < 20000; ++run) {
    WrittenMap written(small.map);
    for (std::size_t k = below(3) + 1; k > 0; --k) {
      auto& array = written.array(below(written.n_arrays()));
      if (array.empty()) continue;
      const std::size_t place = below(array.size());
      switch (below(4)) {
        case 0:
          array[place] ^= static_cast<std::uint8_t>(1U << below(8));
          break;
        case 1:
          array[place] = static_cast<std::uint8_t>(random());
          break;
        case 2: {  // NaN, infinity, the largest and smallest numbers
          const std::array<std::uint64_t, 5> special{0x7FF8000000000000U, 0x7FF0000000000000U,
                                                     0x7FFFFFFFFFFFFFFFU, 0x8000000000000000U,
                                                     0xFFFFFFFFFFFFFFFFU};
          const std::uint64_t value = special[below(special.size())];
          const std::size_t start = place / 8 * 8;
          std::memcpy(array.data() + start, &value, std::min<std::size_t>(8, array.size() - start));
          break;
        }
        default:
          std::swap(array[place], array[below(array.size())]);
      }
    }
    Map map;
    try {
      written.restore(map);
    } catch (const MapFileError&) {
      ++n_refused;
      ASSERT_EQ(map.n_keyframes(), 0U) << "run " << run;
      continue;
    }
    ++n_restored;
    ASSERT_EQ(violations(map), "") << "run " << run;
  }
  EXPECT_GT(n_refused, 2000);
  EXPECT_GT(n_restored, 2000);
}

}  // namespace
}  // namespace orbslam::testing
