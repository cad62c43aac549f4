// SPDX-License-Identifier: BSD-3-Clause
#include "places/keyframe_index.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <thread>

#include "base/errors.hpp"

namespace orbslam {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

/// Words 1 .. n_common, whose L1 score with the query is `score`, and a word of its own.
std::shared_ptr<const Frame> frame_sharing(int n_common, double score, std::uint32_t own) {
  auto frame = std::make_shared<Frame>();
  for (int i = 1; i <= n_common; ++i) {
    frame->words.words.push_back(static_cast<std::uint32_t>(i));
    frame->words.weights.push_back(i == 1 ? score : 0);
  }
  frame->words.words.push_back(1000 + own);
  frame->words.weights.push_back(1 - score);
  frame->described = true;
  return frame;
}

/// The worked example: Q has ten words; A, B, C, D share 10, 9, 8 and 7 of them.
class WorkedExample : public ::testing::Test {
 protected:
  WorkedExample() {
    for (std::uint32_t word = 1; word <= 10; ++word) {
      query_words_.words.push_back(word);
      query_words_.weights.push_back(word == 1 ? 1.0 : 0.0);  // so that scores are exact
    }
  }
  void fill(double score_a, double score_b) {
    index_.clear();
    index_.add(a, frame_sharing(10, score_a, 0));
    index_.add(b, frame_sharing(9, score_b, 1));
    index_.add(c, frame_sharing(8, 0.3, 2));
    index_.add(d, frame_sharing(7, 0.3, 3));
  }
  std::vector<PlaceCandidate> query(double min_score, std::vector<KeyFrameId> excluded = {}) const {
    return index_.query(query_words_, {std::move(excluded), min_score}, [this](KeyFrameId id) {
      const auto found = neighbours_.find(id);
      return found == neighbours_.end() ? std::vector<KeyFrameId>() : found->second;
    });
  }
  static std::vector<KeyFrameId> ids(const std::vector<PlaceCandidate>& candidates) {
    std::vector<KeyFrameId> result;
    for (const PlaceCandidate& candidate : candidates) result.push_back(candidate.keyframe);
    return result;
  }

  const KeyFrameId a{1}, b{2}, c{3}, d{4};
  KeyFrameIndex index_;
  WordVector query_words_;
  std::map<KeyFrameId, std::vector<KeyFrameId>> neighbours_{{a, {b, c}}, {b, {a}}};
};

// OD-47: neighbours that were not scored add nothing.
TEST_F(WorkedExample, OnlyAPasses) {
  fill(0.10, 0.05);
  const auto found = query(0.06);
  ASSERT_THAT(ids(found), ElementsAre(a));
  EXPECT_EQ(found[0].common_words, 10);
  EXPECT_NEAR(found[0].score, 0.10, 1e-12);
  EXPECT_NEAR(found[0].group_score, 0.15, 1e-12);  // B counts, C has too few words
}

TEST_F(WorkedExample, BIsTheBestOfBothGroupsAndComesOnce) {
  fill(0.10, 0.12);
  const auto found = query(0.06);
  ASSERT_THAT(ids(found), ElementsAre(b));
  EXPECT_NEAR(found[0].group_score, 0.22, 1e-12);
}

TEST_F(WorkedExample, NothingReachesTheMinimum) {
  fill(0.10, 0.05);
  EXPECT_THAT(query(0.11), IsEmpty());
}

TEST_F(WorkedExample, RelocalizationNeedsNoMinimum) {
  fill(0.10, 0.05);
  neighbours_.clear();
  EXPECT_THAT(ids(query(0)), ElementsAre(a));  // 0.05 is below 0.75 of 0.10
  fill(0.10, 0.08);
  EXPECT_THAT(ids(query(0)), ElementsAre(a, b));
}

TEST_F(WorkedExample, TheGroupLimitIsStrictAndTheMinimumIsNot) {
  neighbours_.clear();
  fill(0.5, 0.375);
  EXPECT_THAT(ids(query(0)), ElementsAre(a));
  EXPECT_THAT(ids(query(0.5)), ElementsAre(a));
  fill(0.5, 0.376);
  EXPECT_THAT(ids(query(0)), ElementsAre(a, b));
}

TEST_F(WorkedExample, ExcludedKeyframesAreNotCounted) {
  fill(0.10, 0.05);
  // Without A the largest count is 9, min_common 7: B and C are kept.
  const auto found = query(0, {a});
  EXPECT_THAT(ids(found), ElementsAre(c));
  EXPECT_THAT(query(0, {a, b, c, d}), IsEmpty());
}

TEST_F(WorkedExample, OnlyTenNeighboursMakeAGroup) {
  fill(0.10, 0.05);
  neighbours_[a].assign(10, KeyFrameId(77));
  neighbours_[a].push_back(b);
  EXPECT_NEAR(query(0.06)[0].group_score, 0.10, 1e-12);
}

TEST_F(WorkedExample, ErasedKeyframesAreNotFound) {
  fill(0.10, 0.12);
  index_.erase(b);
  index_.erase(KeyFrameId(99));
  EXPECT_FALSE(index_.contains(b));
  EXPECT_EQ(index_.size(), 3U);
  EXPECT_THAT(ids(query(0.06)), ElementsAre(a));
  index_.add(KeyFrameId(5), frame_sharing(10, 0.2, 4));  // takes the free slot
  EXPECT_THAT(ids(query(0.06)), ElementsAre(KeyFrameId(5)));
  index_.clear();
  EXPECT_THAT(query(0), IsEmpty());
}

TEST_F(WorkedExample, AddingTwiceDoesNothing) {
  fill(0.10, 0.05);
  index_.add(a, frame_sharing(10, 0.9, 0));
  EXPECT_EQ(index_.size(), 4U);
  EXPECT_NEAR(query(0.06)[0].score, 0.10, 1e-12);
}

TEST_F(WorkedExample, FramesWithoutWordsAreRefused) {
  EXPECT_THROW(index_.add(a, std::make_shared<Frame>()), StateError);
}

// OD-47, OD-48: queries leave nothing behind, no counters, scores or marks.
TEST_F(WorkedExample, QueriesRunWhileKeyframesComeAndGo) {
  fill(0.10, 0.05);
  std::thread writer([this] {
    for (int i = 0; i < 300; ++i) {
      const KeyFrameId id(100 + i);
      index_.add(id, frame_sharing(3, 0.3, 9));
      index_.erase(id);
    }
  });
  for (int i = 0; i < 300; ++i) EXPECT_THAT(ids(query(0.06)), ElementsAre(a));
  writer.join();
  EXPECT_EQ(index_.size(), 4U);
}

}  // namespace
}  // namespace orbslam
