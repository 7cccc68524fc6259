#include "../png_depth.hpp"

#include <random>

#include <benchmark/benchmark.h>

#include "../tests/sequence_testing.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::depth_sequence {
namespace {

/// A VGA image with the slopes, edges, holes and noise that decide how well depth compresses.
void BM_ReadVgaFrame(benchmark::State& state) {
  const testing_support::TemporaryFolder folder;
  std::mt19937 random(1);
  std::vector<std::uint16_t> values;
  for (int v = 0; v < 480; ++v) {
    for (int u = 0; u < 640; ++u) {
      const auto noise = static_cast<int>(random() % 9);
      const bool hole = (u / 40 + v / 40) % 11 == 0;
      values.push_back(static_cast<std::uint16_t>(hole ? 0 : 1500 + u + 3 * v + noise));
    }
  }
  const auto file = folder.path() / "frame.png";
  testing::write_png(file, 640, 480, values);
  for (auto _ : state) benchmark::DoNotOptimize(read_png_depth(file));
}
BENCHMARK(BM_ReadVgaFrame)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace sidestep::depth_sequence
