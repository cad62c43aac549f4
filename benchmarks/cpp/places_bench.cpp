// SPDX-License-Identifier: BSD-3-Clause
// Words and direct index of an image, scores, opening and training of vocabularies.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <random>

#include "measure.hpp"
#include "places/vocabulary.hpp"
#include "places/vocabulary_training.hpp"

namespace orbslam {
namespace {

/// Like descriptors of images: clusters within clusters rather than noise.
std::vector<Descriptor> clustered(std::size_t n, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<Descriptor> descriptors;
  const auto noise = [&] { return Descriptor{{random(), random(), random(), random()}}; };
  descriptors.push_back(noise());
  while (descriptors.size() < n) {
    Descriptor descriptor = descriptors[random() % std::min<std::size_t>(descriptors.size(), 4000)];
    for (int i = 0; i < 40; ++i) {
      const auto bit = random() % 256;
      descriptor.words[bit / 64] ^= std::uint64_t{1} << (bit % 64);
    }
    descriptors.push_back(descriptor);
  }
  return descriptors;
}

/// A complete tree, filled with random centres: the cost of a descent does not depend on them.
std::shared_ptr<const Vocabulary> full_tree(int depth) {
  std::mt19937_64 random(1);
  NodeTable table;
  std::vector<std::uint32_t> level{0};
  for (int d = 1; d <= depth; ++d) {
    std::vector<std::uint32_t> next;
    for (const std::uint32_t parent : level) {
      for (int child = 0; child < 10; ++child) {
        table.parents.push_back(parent);
        table.is_word.push_back(d == depth ? 1 : 0);
        table.centres.push_back({{random(), random(), random(), random()}});
        table.weights.push_back(d == depth ? 1.0 + static_cast<double>(random() % 100) : 0.0);
        next.push_back(static_cast<std::uint32_t>(table.parents.size()));
      }
    }
    level = std::move(next);
  }
  return Vocabulary::from_rows(
      10, depth, Scoring::kL1, Weighting::kTfIdf,
      {table.parents.size(), table.parents.data(), table.is_word.data(),
       reinterpret_cast<const std::uint8_t*>(table.centres.data()), table.weights.data()});
}

const Vocabulary& tree(int depth) {
  static const auto small = full_tree(5);
  static const auto large = full_tree(6);
  return depth == 5 ? *small : *large;
}

void transform(benchmark::State& state) {
  const Vocabulary& vocabulary = tree(static_cast<int>(state.range(0)));
  const auto n = static_cast<std::size_t>(state.range(1));
  std::vector<std::vector<Descriptor>> images;
  for (std::uint64_t seed = 0; seed < 16; ++seed) images.push_back(clustered(n, seed));
  WordVector words;
  DirectIndex index;
  std::size_t image = 0;
  measure(state, [&] { vocabulary.transform(images[image++ % images.size()], words, index); });
}
BENCHMARK(transform)
    ->ArgNames({"depth", "features"})
    ->ArgsProduct({{5, 6}, {1000, 2000}})
    ->Unit(benchmark::kMillisecond);

void score(benchmark::State& state) {
  WordVector words[2];
  DirectIndex index;
  for (std::uint64_t i = 0; i < 2; ++i) tree(5).transform(clustered(1000, i), words[i], index);
  for (auto _ : state) benchmark::DoNotOptimize(similarity(words[0], words[1]));
}
BENCHMARK(score)->Unit(benchmark::kMicrosecond);

void open_file(benchmark::State& state) {
  const auto path = std::filesystem::temp_directory_path() / "places_bench.bvoc";
  tree(static_cast<int>(state.range(0))).save(path.string());
  for (auto _ : state) benchmark::DoNotOptimize(Vocabulary::open(path.string()));
  std::filesystem::remove(path);
}
BENCHMARK(open_file)->ArgName("depth")->Arg(5)->Arg(6)->Unit(benchmark::kMillisecond);

void train(benchmark::State& state) {
  const TrainingSet set{clustered(200000, 1), {100000, 200000}};
  TrainingOptions options;
  options.n_threads = static_cast<int>(state.range(0));
  for (auto _ : state) benchmark::DoNotOptimize(train_vocabulary(set, options));
}
BENCHMARK(train)->ArgName("threads")->Arg(1)->Arg(2)->Iterations(2)->UseRealTime()->Unit(
    benchmark::kMillisecond);

}  // namespace
}  // namespace orbslam
