#include <thread>

#include <benchmark/benchmark.h>

#include "../simulator.hpp"
#include "../tests/simulator_testing.hpp"

namespace sidestep::simulator {
namespace {

/// One VGA frame of the furnished room.
void render_room(benchmark::State& state, const std::string& noise) {
  conformance::TestHost host(static_cast<int>(std::max(1U, std::thread::hardware_concurrency())),
                             testing::host_parts());
  Options options = testing::room_options();
  options.frames = 0;
  options.noise.model = noise;
  const auto source = create_source(options, host.context(1));
  if (!source) {
    state.SkipWithError(source.error().describe().c_str());
    return;
  }
  for (auto _ : state) benchmark::DoNotOptimize((*source)->next(Deadline()));
}
BENCHMARK_CAPTURE(render_room, exact, "none")->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK_CAPTURE(render_room, kinect, "kinect")->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace sidestep::simulator
