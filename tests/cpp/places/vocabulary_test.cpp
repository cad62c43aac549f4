// SPDX-License-Identifier: BSD-3-Clause
#include "places/vocabulary.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/errors.hpp"
#include "places/golden_vocabulary.hpp"

namespace orbslam {
namespace {

using testing::bow_file;
using ::testing::ElementsAre;
using testing::golden_vocabulary;
using ::testing::HasSubstr;
using testing::read_descriptors;
using testing::read_npy;

/// A descriptor with the first `n` bits set.
Descriptor ones(int n) {
  Descriptor d;
  for (int bit = 0; bit < n; ++bit) d.words[bit / 64] |= std::uint64_t{1} << (bit % 64);
  return d;
}

std::shared_ptr<const Vocabulary> build(const std::vector<VocabularyNode>& nodes, int branching = 3,
                                        int depth = 3, Weighting weighting = Weighting::kTfIdf) {
  return Vocabulary::from_nodes(branching, depth, Scoring::kL1, weighting, nodes);
}

std::string error_of(const std::vector<VocabularyNode>& nodes, int branching = 3, int depth = 3) {
  try {
    build(nodes, branching, depth);
  } catch (const VocabularyError& error) {
    return error.what();
  }
  return "no error";
}

/// Words at depths 1, 2 and 3: node 1 is a word; 2 -> {3, 4}; 4 -> {5, 6}.
std::vector<VocabularyNode> uneven_tree() {
  return {{0, true, ones(0), 1.0},  {0, false, ones(128), 0},  {2, true, ones(100), 2.0},
          {2, false, ones(200), 0}, {4, true, ones(180), 3.0}, {4, true, ones(256), 0.0}};
}

class GoldenImages : public ::testing::TestWithParam<int> {
 protected:
  std::string name(const std::string& what) const {
    return "out" + std::to_string(GetParam()) + "_" + what;
  }
};
INSTANTIATE_TEST_SUITE_P(Places, GoldenImages, ::testing::Values(0, 1));

TEST_P(GoldenImages, EveryFeatureFallsIntoTheReferencesWord) {
  const auto vocabulary = golden_vocabulary();
  const auto descriptors = read_descriptors("desc" + std::to_string(GetParam()));
  const auto words = read_npy<std::uint32_t>(bow_file(name("feat_word")));
  const auto weights = read_npy<double>(bow_file(name("feat_weight")));
  const auto nodes = read_npy<std::uint32_t>(bow_file(name("feat_node_up1")));
  ASSERT_EQ(descriptors.size(), words.values.size());
  for (std::size_t i = 0; i < descriptors.size(); ++i) {
    const Quantised q = vocabulary->quantise(descriptors[i]);
    EXPECT_EQ(q.word, words.at(i)) << i;
    EXPECT_EQ(q.node, nodes.at(i)) << i;
    EXPECT_NEAR(q.weight, weights.at(i), 1e-6) << i;
  }
}

TEST_P(GoldenImages, WordVectorAndDirectIndexAreTheReferences) {
  const auto vocabulary = golden_vocabulary();
  WordVector words;
  DirectIndex index;
  vocabulary->transform(read_descriptors("desc" + std::to_string(GetParam())), words, index);
  EXPECT_EQ(words.words, read_npy<std::uint32_t>(bow_file(name("bow_word"))).values);
  const auto weights = read_npy<double>(bow_file(name("bow_weight"))).values;
  ASSERT_EQ(words.weights.size(), weights.size());
  for (std::size_t i = 0; i < weights.size(); ++i) EXPECT_NEAR(words.weights[i], weights[i], 1e-6);
  // One level above the leaves of a depth-3 tree is depth 2.
  EXPECT_EQ(index.nodes, read_npy<std::uint32_t>(bow_file(name("fv_up1_node"))).values);
  EXPECT_EQ(index.offsets, read_npy<std::uint32_t>(bow_file(name("fv_up1_offset"))).values);
  EXPECT_EQ(index.indices, read_npy<std::uint32_t>(bow_file(name("fv_up1_index"))).values);
}

/// What a feature's word says is all that vectors and index need.
TEST_P(GoldenImages, KnownWordsGiveTheSameAsDescriptors) {
  const auto vocabulary = golden_vocabulary();
  const auto descriptors = read_descriptors("desc" + std::to_string(GetParam()));
  WordVector words, again;
  DirectIndex index, index_again;
  vocabulary->transform(descriptors, words, index);
  std::vector<std::uint32_t> words_of_features(descriptors.size(), kNoWord);
  for (std::size_t i = 0; i < index.indices.size(); ++i) {
    words_of_features[index.indices[i]] = index.words[i];
    EXPECT_EQ(index.words[i], vocabulary->quantise(descriptors[index.indices[i]]).word);
  }
  vocabulary->transform(words_of_features.data(), words_of_features.size(), again, index_again);
  EXPECT_EQ(again.words, words.words);
  EXPECT_EQ(again.weights, words.weights) << "bit by bit";
  EXPECT_EQ(index_again.nodes, index.nodes);
  EXPECT_EQ(index_again.offsets, index.offsets);
  EXPECT_EQ(index_again.indices, index.indices);
  EXPECT_EQ(index_again.words, index.words);
}

TEST(Similarity, MatchesTheReference) {
  const auto vocabulary = golden_vocabulary();
  WordVector words[2];
  DirectIndex index;
  vocabulary->transform(read_descriptors("desc0"), words[0], index);
  vocabulary->transform(read_descriptors("desc1"), words[1], index);
  const auto scores = read_npy<double>(bow_file("out_score"));
  EXPECT_NEAR(similarity(words[0], words[1]), scores.at(0), 1e-6);
  EXPECT_NEAR(similarity(words[0], words[0]), scores.at(1), 1e-6);
  EXPECT_NEAR(similarity(words[1], words[1]), scores.at(2), 1e-6);
}

TEST(Similarity, IsZeroForDisjointAndTheCommonMassOtherwise) {
  EXPECT_DOUBLE_EQ(similarity({{1, 3}, {0.5, 0.5}}, {{2, 4}, {0.5, 0.5}}), 0.0);
  EXPECT_DOUBLE_EQ(similarity({{1, 3}, {0.25, 0.75}}, {{3, 4}, {0.5, 0.5}}), 0.5);
  EXPECT_DOUBLE_EQ(similarity({}, {{3}, {1.0}}), 0.0);
}

TEST(Vocabulary, CountsNodesWithTheRoot) {
  const auto vocabulary = golden_vocabulary();
  EXPECT_EQ(vocabulary->n_words(), 1000U);
  EXPECT_EQ(vocabulary->n_nodes(), 1111U);
  EXPECT_EQ(vocabulary->branching(), 10);
  EXPECT_EQ(vocabulary->depth(), 3);
}

// OD-42: words whose branch ends early have a group, too.
TEST(Vocabulary, ShallowLeafIsItsOwnGroup) {
  const auto vocabulary = build(uneven_tree());
  const Quantised shallow = vocabulary->quantise(ones(3));
  EXPECT_EQ(shallow.word, 0U);
  EXPECT_EQ(shallow.node, 1U);
  const Quantised deep = vocabulary->quantise(ones(185));
  EXPECT_EQ(deep.word, 2U);
  EXPECT_EQ(deep.node, 4U);
  EXPECT_DOUBLE_EQ(deep.weight, 3.0);
}

TEST(Vocabulary, TiesGoToTheFirstChild) {
  const auto vocabulary = build({{0, true, ones(0), 1}, {0, true, ones(10), 1}});
  EXPECT_EQ(vocabulary->quantise(ones(5)).word, 0U);
}

TEST(Vocabulary, StoppedWordsAreLeftOut) {
  const auto vocabulary = build(uneven_tree());
  WordVector words;
  DirectIndex index;
  vocabulary->transform({ones(256), ones(185), ones(0), ones(185)}, words, index);
  EXPECT_THAT(words.words, ElementsAre(0U, 2U));
  EXPECT_DOUBLE_EQ(words.weights[0], 1.0 / 7);
  EXPECT_DOUBLE_EQ(words.weights[1], 6.0 / 7);
  EXPECT_THAT(index.nodes, ElementsAre(1U, 4U));
  EXPECT_THAT(index.offsets, ElementsAre(0U, 1U, 3U));
  EXPECT_THAT(index.indices, ElementsAre(2U, 1U, 3U));
}

TEST(Vocabulary, KnownWordsOfUnevenAndStoppedBranches) {
  const auto vocabulary = build(uneven_tree());
  const std::vector<std::uint32_t> known{3, 2, 0, kNoWord, 2};  // word 3 is stopped
  WordVector words;
  DirectIndex index;
  vocabulary->transform(known.data(), known.size(), words, index);
  EXPECT_THAT(words.words, ElementsAre(0U, 2U));
  EXPECT_DOUBLE_EQ(words.weights[1], 6.0 / 7);
  EXPECT_THAT(index.nodes, ElementsAre(1U, 4U));
  EXPECT_THAT(index.indices, ElementsAre(2U, 1U, 4U));
  EXPECT_THAT(index.words, ElementsAre(0U, 2U, 2U));
  const std::uint32_t unknown = 4;
  EXPECT_THROW(vocabulary->transform(&unknown, 1, words, index), VocabularyError);
}

TEST(Vocabulary, DescribingNothingOrOnlyStoppedWordsGivesEmptyVectors) {
  const auto vocabulary = build(uneven_tree());
  WordVector words{{7}, {1.0}};
  DirectIndex index{{1}, {0, 1}, {0}, {7}};
  for (const auto& descriptors : {std::vector<Descriptor>{}, std::vector<Descriptor>{ones(256)}}) {
    vocabulary->transform(descriptors, words, index);
    EXPECT_TRUE(words.words.empty() && words.weights.empty());
    EXPECT_TRUE(index.nodes.empty() && index.indices.empty());
    EXPECT_THAT(index.offsets, ElementsAre(0U));
  }
}

TEST(Vocabulary, IdfWeightingIgnoresRepetitions) {
  const auto vocabulary = build(uneven_tree(), 3, 3, Weighting::kIdf);
  WordVector words;
  DirectIndex index;
  vocabulary->transform({ones(185), ones(0), ones(185)}, words, index);
  EXPECT_DOUBLE_EQ(words.weights[0], 1.0 / 4);
  EXPECT_DOUBLE_EQ(words.weights[1], 3.0 / 4);
}

TEST(Vocabulary, DescribeFillsAFrameOnce) {
  Frame frame;
  frame.descriptors = {ones(0), ones(100)};
  const auto vocabulary = build(uneven_tree());
  describe(frame, *vocabulary);
  EXPECT_TRUE(frame.described);
  EXPECT_THAT(frame.words.words, ElementsAre(0U, 1U));
  EXPECT_THAT(frame.direct_index.nodes, ElementsAre(1U, 3U));
  frame.descriptors.clear();
  describe(frame, *vocabulary);
  EXPECT_EQ(frame.words.words.size(), 2U);
}

TEST(Vocabulary, NodesComeBackInTheirOrder) {
  const auto nodes = testing::golden_nodes();
  const auto again = golden_vocabulary()->nodes();
  ASSERT_EQ(again.size(), nodes.size());
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    EXPECT_EQ(again[i].parent, nodes[i].parent);
    EXPECT_EQ(again[i].is_word, nodes[i].is_word);
    EXPECT_EQ(again[i].centre, nodes[i].centre);
    EXPECT_EQ(again[i].weight, nodes[i].is_word ? nodes[i].weight : 0);
  }
}

TEST(Vocabulary, HashDependsOnTheContentOnly) {
  auto nodes = uneven_tree();
  const auto hash = build(nodes)->hash();
  EXPECT_EQ(build(nodes)->hash(), hash);
  nodes[4].weight = 3.5;
  EXPECT_NE(build(nodes)->hash(), hash);
}

TEST(VocabularyNodes, NamesTheFirstBadNode) {
  const auto broken = [](std::size_t node, auto change) {
    auto nodes = uneven_tree();
    change(nodes[node - 1]);
    return error_of(nodes);
  };
  using Node = VocabularyNode;
  EXPECT_THAT(broken(3, [](Node& n) { n.parent = 3; }), HasSubstr("node 3: its parent 3"));
  EXPECT_THAT(broken(3, [](Node& n) { n.parent = 99; }), HasSubstr("node 3: its parent 99"));
  EXPECT_THAT(broken(3, [](Node& n) { n.parent = 1; }),
              HasSubstr("node 3: its parent 1 is marked"));
  EXPECT_THAT(broken(5, [](Node& n) { n.is_word = false; }), HasSubstr("node 5: it has no child"));
  EXPECT_THAT(broken(5, [](Node& n) { n.weight = -1; }), HasSubstr("node 5: its weight"));
  EXPECT_THAT(broken(5, [](Node& n) { n.weight = std::numeric_limits<double>::quiet_NaN(); }),
              HasSubstr("node 5: its weight"));
  EXPECT_THAT(error_of(uneven_tree(), 3, 2), HasSubstr("node 5: it lies deeper"));
  EXPECT_THAT(error_of(std::vector<VocabularyNode>(4, {0, true, ones(1), 1})),
              HasSubstr("node 4: its parent 0 has more than 3 children"));
}

TEST(VocabularyNodes, RefusesImpossibleTrees) {
  EXPECT_THAT(error_of({}), HasSubstr("no words"));
  EXPECT_THAT(error_of(uneven_tree(), 1, 3), HasSubstr("branching is 1, must be 2 to 20"));
  EXPECT_THAT(error_of(uneven_tree(), 0, 3), HasSubstr("branching"));
  EXPECT_THAT(error_of(uneven_tree(), 3, 0), HasSubstr("depth"));
  EXPECT_THROW(Vocabulary::from_nodes(3, 3, Scoring::kL2, Weighting::kTfIdf, uneven_tree()),
               VocabularyError);
}

}  // namespace
}  // namespace orbslam
