// SPDX-License-Identifier: BSD-3-Clause
#include "places/place_recognition.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/errors.hpp"

namespace orbslam {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

std::shared_ptr<Frame> frame_with(std::vector<std::uint32_t> words) {
  auto frame = std::make_shared<Frame>();
  frame->keypoints.resize(40);
  frame->descriptors.resize(40);
  frame->depth.assign(40, -1.0F);
  frame->right_u.assign(40, -1.0F);
  frame->scales = std::make_shared<ScalePyramid>(1.2F, 8);
  frame->words.weights.assign(words.size(), 1.0 / static_cast<double>(words.size()));
  frame->words.words = std::move(words);
  frame->described = true;
  return frame;
}

/// Keyframes 0 to 3; 0 and 1 share 20 points, 2 and 3 share none with anyone.
class PlaceRecognition : public ::testing::Test {
 protected:
  PlaceRecognition() {
    const auto lock = map_.write_lock();
    for (const auto& words : std::vector<std::vector<std::uint32_t>>{
             {1, 2, 3, 4}, {1, 2, 3, 5}, {1, 2, 3, 4}, {7, 8, 9, 10}}) {
      const KeyFrameId id = map_.add_keyframe(frame_with(words), Pose());
      map_.publish(id);
      ids_.push_back(id);
    }
    for (std::size_t i = 0; i < 20; ++i) {
      const MapPointId point = map_.add_point({0, 0, 2}, ids_[0], 0);
      map_.add_observation(point, ids_[0], i);
      map_.add_observation(point, ids_[1], i);
    }
    map_.update_connections(ids_[0]);
    map_.update_connections(ids_[1]);
  }
  void index_all() {
    for (const KeyFrameId id : ids_) index_keyframe(index_, map_, id);
  }
  static std::vector<KeyFrameId> ids(const std::vector<PlaceCandidate>& candidates) {
    std::vector<KeyFrameId> result;
    for (const PlaceCandidate& candidate : candidates) result.push_back(candidate.keyframe);
    return result;
  }

  Map map_;
  KeyFrameIndex index_;
  std::vector<KeyFrameId> ids_;
};

TEST_F(PlaceRecognition, LoopsAreSoughtAmongUnconnectedKeyframes) {
  index_all();
  // Keyframe 1 shares as many words with 0, but is connected to it.
  EXPECT_THAT(ids(find_loop_candidates(index_, map_, ids_[0], 0)), ElementsAre(ids_[2]));
  EXPECT_THAT(find_loop_candidates(index_, map_, ids_[3], 0), IsEmpty());
  EXPECT_THAT(find_loop_candidates(index_, map_, KeyFrameId(9), 0), IsEmpty()) << "it has died";
}

TEST_F(PlaceRecognition, RelocalizationSeeksEverywhereAndGroupsNeighbours) {
  index_all();
  const auto found = find_relocalization_candidates(index_, map_, *frame_with({1, 2, 3, 5}));
  ASSERT_THAT(ids(found), ElementsAre(ids_[1]));
  EXPECT_DOUBLE_EQ(found[0].score, 1.0);
  EXPECT_EQ(found[0].common_words, 4);
}

// OD-49: a keyframe that was culled while it waited is not indexed.
TEST_F(PlaceRecognition, DeadKeyframesNeitherEnterNorAppear) {
  index_all();
  {
    const auto lock = map_.write_lock();
    EXPECT_TRUE(map_.erase_keyframe(ids_[2]));
  }
  // Not erased from the index yet, but dead.
  EXPECT_THAT(find_loop_candidates(index_, map_, ids_[0], 0), IsEmpty());
  index_.erase(ids_[2]);
  index_keyframe(index_, map_, ids_[2]);
  EXPECT_FALSE(index_.contains(ids_[2]));
  EXPECT_TRUE(index_.contains(ids_[0]));
}

TEST_F(PlaceRecognition, LowestScoreAmongNeighbours) {
  EXPECT_DOUBLE_EQ(lowest_neighbour_score(map_, ids_[0]), 0.75);
  EXPECT_DOUBLE_EQ(lowest_neighbour_score(map_, ids_[3]), 1.0);
  EXPECT_DOUBLE_EQ(lowest_neighbour_score(map_, KeyFrameId(9)), 1.0);
}

}  // namespace
}  // namespace orbslam
