// What looking on costs: the robot's threads (mapped, stepped, happened), and the viewer's own
// (bits, messages), on the grid of the live scenarios: 256 x 256 x 80 voxels, 1,280 blocks.
#include <benchmark/benchmark.h>

#include <sidestep/core/log.hpp>
#include <sidestep/field/occupancy_bits.hpp>

#include "view_feed.hpp"
#include "view_testing.hpp"

namespace sidestep {
namespace {

using testing_support::ball_world;
using testing_support::map_at;
using testing_support::step_at;

FieldInfo live_field_info() {
  FieldInfo info;
  info.grid.origin_m = {-3.2, -3.2, 0.0};
  info.grid.resolution_m = 0.025;
  info.grid.size_vox = {256, 256, 80};
  info.max_distance_m = 0.6;
  return info;
}

class NoLog final : public Log {
 public:
  void write(LogLevel, std::string_view) override {}
};

/// A page that reads everything at once.
class OpenSink final : public ViewSink {
 public:
  explicit OpenSink(bool any) : any_(any) {}
  Demand demand() override { return {any_, std::exchange(is_new_, false) && any_, {}}; }
  void greet(const std::vector<ViewMessage>&) override {}
  void publish(const ViewMessage& message) override {
    benchmark::DoNotOptimize(message.bytes->data());
  }
  void publish_slice(const SliceRequest&, const ViewMessage&) override {}

 private:
  bool any_;
  bool is_new_ = true;
};

/// `state.range(0)`: whether a page is connected.
void BM_stepped(benchmark::State& state) {
  NoLog log;
  OpenSink sink(state.range(0) != 0);
  ViewFeed feed({&sink}, log);
  feed.begin(ball_world());
  ObservedStep step = step_at(0.0);
  for (auto _ : state) {
    step.stamp.ns += 4'000'000;
    feed.stepped(step);
  }
}
BENCHMARK(BM_stepped)->Arg(0)->Arg(1);

void BM_mapped(benchmark::State& state) {
  NoLog log;
  OpenSink sink(state.range(0) != 0);
  ViewFeed feed({&sink}, log);
  feed.begin(ball_world());
  const auto field = testing_support::ball_field({0.0, 0.0, 1.0}, live_field_info());
  ObservedMap map = map_at(0.0, 0, field);
  for (auto _ : state) {
    ++map.step.frame_sequence;
    feed.mapped(map);
  }
}
BENCHMARK(BM_mapped)->Arg(0)->Arg(1);

void BM_happened(benchmark::State& state) {
  NoLog log;
  OpenSink sink(false);
  ViewFeed feed({&sink}, log);
  feed.begin(ball_world());
  const ObservedEvent event = testing_support::plan_at(1.0);
  for (auto _ : state) feed.happened(event);
}
BENCHMARK(BM_happened);

/// A map in which `state.range(0)` blocks of 1,280 are others than before.
void BM_changed_bits(benchmark::State& state) {
  const auto first = testing_support::ball_field({0.0, 0.0, 1.0}, live_field_info());
  const auto second = testing_support::ball_field({0.5, 0.0, 1.0}, live_field_info());
  DenseField::Blocks blocks = first->blocks();
  for (int i = 0; i < state.range(0); ++i) {
    const auto at =
        static_cast<std::size_t>(i) * blocks.size() / static_cast<std::size_t>(state.range(0));
    blocks.set(at, second->blocks()[at]);
  }
  const std::shared_ptr<const DenseField> fields[] = {
      first, std::make_shared<const DenseField>(first->info(), blocks, first->known_blocks())};
  OccupancyBits bits;
  std::size_t turn = 0;
  for (auto _ : state) benchmark::DoNotOptimize(bits.update(fields[turn++ % 2]));
}
BENCHMARK(BM_changed_bits)->Arg(0)->Arg(100)->Arg(1280)->Unit(benchmark::kMicrosecond);

void BM_full_map_message(benchmark::State& state) {
  OccupancyBits bits;
  (void)bits.update(testing_support::ball_field({0.0, 0.0, 1.0}, live_field_info()));
  for (auto _ : state) {
    benchmark::DoNotOptimize(map_message({}, {}, bits, bits.filled(), true));
  }
}
BENCHMARK(BM_full_map_message)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace sidestep
