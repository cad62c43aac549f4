// SPDX-License-Identifier: BSD-3-Clause
#include "places/vocabulary_training.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>

#include "base/errors.hpp"
#include "places/golden_vocabulary.hpp"
#include "support/no_new_threads.hpp"

namespace orbslam {
namespace {

/// The descriptors of both golden images, cut into images of 100.
TrainingSet golden_set() {
  TrainingSet set;
  for (const char* name : {"desc0", "desc1"}) {
    const auto descriptors = testing::read_descriptors(name);
    set.descriptors.insert(set.descriptors.end(), descriptors.begin(), descriptors.end());
  }
  for (std::size_t end = 100; end < set.descriptors.size(); end += 100) {
    set.image_ends.push_back(end);
  }
  set.image_ends.push_back(set.descriptors.size());
  return set;
}

TrainingOptions small_tree() {
  TrainingOptions options;
  options.branching = 6;
  options.depth = 3;
  options.n_threads = 1;
  return options;
}

TEST(TrainVocabulary, IsReproducibleForAnyNumberOfThreads) {
  const TrainingSet set = golden_set();
  TrainingOptions options = small_tree();
  const auto hash = train_vocabulary(set, options)->hash();
  for (const int n_threads : {1, 2, 5}) {
    options.n_threads = n_threads;
    EXPECT_EQ(train_vocabulary(set, options)->hash(), hash);
  }
  options.seed = 1;
  EXPECT_NE(train_vocabulary(set, options)->hash(), hash);
}

TEST(TrainVocabulary, LargeNodesGiveTheSameWithAllThreads) {
  std::mt19937_64 random(5);
  TrainingSet set;
  for (int i = 0; i < 120000; ++i) {
    set.descriptors.push_back({{random() & 0xff, random() & 0xff, random(), 0}});
  }
  set.image_ends = {60000, 120000};
  TrainingOptions options = small_tree();
  options.depth = 1;
  options.max_iterations = 4;
  const auto one = train_vocabulary(set, options);
  options.n_threads = 2;
  EXPECT_EQ(train_vocabulary(set, options)->hash(), one->hash());
}

TEST(TrainVocabulary, FillsTheTreeAndNumbersItDepthFirst) {
  const auto vocabulary = train_vocabulary(golden_set(), small_tree());
  EXPECT_GT(vocabulary->n_words(), 180U);
  EXPECT_LE(vocabulary->n_words(), 216U);
  const auto nodes = vocabulary->nodes();
  for (std::size_t i = 0; i < 6; ++i) EXPECT_EQ(nodes[i].parent, 0U);
  EXPECT_EQ(nodes[6].parent, 1U);
  // Below the first child of the root: its children, then the subtree of its own first child.
  const auto first_grandchild = std::find_if(nodes.begin(), nodes.end(),
                                             [](const VocabularyNode& n) { return n.parent == 7; });
  const auto second_subtree = std::find_if(nodes.begin(), nodes.end(),
                                           [](const VocabularyNode& n) { return n.parent == 2; });
  EXPECT_LT(first_grandchild, second_subtree);
}

TEST(TrainVocabulary, WeighsWordsByTheImagesThatHaveThem) {
  const TrainingSet set = golden_set();
  const auto vocabulary = train_vocabulary(set, small_tree());
  std::vector<std::size_t> n_images(vocabulary->n_words(), 0);
  std::size_t begin = 0;
  for (const std::size_t end : set.image_ends) {
    std::vector<bool> seen(vocabulary->n_words(), false);
    for (; begin < end; ++begin) seen[vocabulary->quantise(set.descriptors[begin]).word] = true;
    for (std::size_t word = 0; word < seen.size(); ++word) n_images[word] += seen[word] ? 1 : 0;
  }
  for (const Descriptor& descriptor : set.descriptors) {
    const Quantised q = vocabulary->quantise(descriptor);
    EXPECT_DOUBLE_EQ(q.weight, std::log(static_cast<double>(set.image_ends.size()) /
                                        static_cast<double>(n_images[q.word])));
  }
}

TEST(TrainVocabulary, StopListAndOtherWeightings) {
  TrainingOptions options = small_tree();
  options.minimum_weight = 1.5;
  const TrainingSet set = golden_set();
  const auto stopped = train_vocabulary(set, options);
  int n_stopped = 0;
  for (const Descriptor& descriptor : set.descriptors) {
    const double weight = stopped->quantise(descriptor).weight;
    EXPECT_TRUE(weight == 0 || weight >= 1.5);
    n_stopped += weight == 0 ? 1 : 0;
  }
  EXPECT_GT(n_stopped, 0);
  options.weighting = Weighting::kTf;
  EXPECT_DOUBLE_EQ(train_vocabulary(set, options)->quantise(set.descriptors[0]).weight, 1.0);
}

// OD-44: equal descriptors are counted, not repeated.
TEST(TrainVocabulary, EqualDescriptorsMakeNoChains) {
  TrainingSet set;
  std::mt19937_64 random(3);
  for (int i = 0; i < 8; ++i) {
    const Descriptor descriptor{{random(), random(), random(), random()}};
    for (int copy = 0; copy < 50; ++copy) set.descriptors.push_back(descriptor);
  }
  set.image_ends = {100, 200, set.descriptors.size()};
  const auto vocabulary = train_vocabulary(set, small_tree());
  EXPECT_EQ(vocabulary->n_words(), 8U);
  for (const VocabularyNode& node : vocabulary->nodes()) {
    if (node.is_word) continue;
    EXPECT_GT(std::count_if(set.descriptors.begin(), set.descriptors.end(),
                            [&](const Descriptor& d) { return !(d == node.centre); }),
              0);
  }
}

TEST(TrainVocabulary, ProgressAscendsToOneAndCancels) {
  std::vector<double> heard;
  const auto listen = [&](double fraction) {
    heard.push_back(fraction);
    return true;
  };
  ASSERT_TRUE(train_vocabulary(golden_set(), small_tree(), listen));
  EXPECT_TRUE(std::is_sorted(heard.begin(), heard.end()));
  EXPECT_EQ(heard.back(), 1.0);
  EXPECT_GT(heard.size(), 3U);
  for (const double limit : {0.0, 0.3, 0.95, 1.0}) {
    EXPECT_EQ(train_vocabulary(golden_set(), small_tree(),
                               [limit](double fraction) { return fraction < limit; }),
              nullptr);
  }
}

TEST(TrainVocabulary, NobodyIsAskedAgainAfterANo) {
  // Two groups that are clustered one after the other, as they are large.
  std::mt19937_64 random(7);
  TrainingSet set;
  for (int i = 0; i < 220000; ++i) {
    const std::uint64_t group = i % 2 == 0 ? 0 : ~std::uint64_t{0};
    set.descriptors.push_back({{random(), group, group, group}});
  }
  set.image_ends = {set.descriptors.size()};
  TrainingOptions options;
  options.branching = 2;
  options.depth = 2;
  options.max_iterations = 2;
  for (const int n_threads : {1, 2}) {
    options.n_threads = n_threads;
    std::vector<double> heard;
    const auto all = [&](double fraction) {
      heard.push_back(fraction);
      return true;
    };
    ASSERT_TRUE(train_vocabulary(set, options, all));
    const std::vector<double> fractions = heard;
    for (std::size_t n = 1; n <= fractions.size(); ++n) {
      heard.clear();
      const auto listener = [&](double fraction) {
        heard.push_back(fraction);
        return heard.size() < n;
      };
      EXPECT_EQ(train_vocabulary(set, options, listener), nullptr);
      EXPECT_EQ(heard.size(), n);
    }
  }
}

TEST(TrainVocabulary, IsTheSameWhereNoThreadCanBeStarted) {
  TrainingOptions options = small_tree();
  const auto hash = train_vocabulary(golden_set(), options)->hash();
  const testing::NoNewThreads none;
  options.n_threads = 8;
  EXPECT_EQ(train_vocabulary(golden_set(), options)->hash(), hash);
}

TEST(TrainVocabulary, AnExceptionOfTheListenerComesThrough) {
  TrainingOptions options = small_tree();
  options.n_threads = 2;
  EXPECT_THROW(train_vocabulary(golden_set(), options,
                                [](double fraction) -> bool {
                                  if (fraction > 0.2) throw std::runtime_error("stop");
                                  return true;
                                }),
               std::runtime_error);
}

TEST(TrainVocabulary, RefusesNonsense) {
  EXPECT_THROW(train_vocabulary({}, small_tree()), VocabularyError);
  TrainingSet set = golden_set();
  set.image_ends.back() += 1;
  EXPECT_THROW(train_vocabulary(set, small_tree()), VocabularyError);
  for (const auto& change : std::vector<void (*)(TrainingOptions&)>{
           [](TrainingOptions& o) { o.branching = 1; }, [](TrainingOptions& o) { o.depth = 0; },
           [](TrainingOptions& o) { o.distance_power = 3; },
           [](TrainingOptions& o) { o.max_iterations = -1; },
           [](TrainingOptions& o) { o.minimum_weight = std::nan(""); }}) {
    TrainingOptions options = small_tree();
    change(options);
    EXPECT_THROW(train_vocabulary(golden_set(), options), SettingsError);
  }
}

}  // namespace
}  // namespace orbslam
