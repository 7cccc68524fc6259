#include <algorithm>
#include <chrono>
#include <cstdio>
#include <functional>
#include <numeric>
#include <vector>

#include "device_checks.hpp"
#include "device_scene.hpp"
#include "transform_checks.hpp"

namespace sidestep::cuda_checks {
namespace {

using cuda::Stage;
using cuda::StageTimes;

constexpr int kRepeats = 21;

double median(std::vector<double> values) {
  std::ranges::nth_element(values, values.begin() + kRepeats / 2);
  return values[kRepeats / 2];
}

/// Medians of the stages and of the time that whoever called waited, in milliseconds.
struct Row {
  std::vector<double> stages[cuda::kStages];
  std::vector<double> waited;

  void add(const StageTimes& times) {
    for (std::size_t s = 0; s < cuda::kStages; ++s) stages[s].push_back(times.ms[s]);
  }
  void print(const char* name) const {
    std::printf("| %s |", name);
    for (const auto& values : stages) std::printf(" %.3f |", median(values));
    std::printf(" %.3f |\n", median(waited));
  }
};

double ms_of(const std::function<void()>& work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  const std::chrono::duration<double, std::milli> passed = std::chrono::steady_clock::now() - begin;
  return passed.count();
}

void fail_loudly(const Error& error) { std::printf("FAILED: %s\n", error.message.c_str()); }

/// The surfaces of a floor, two walls and boxes, one voxel thick.
void furnish(edt_cuda::checks::World& world) {
  const cuda::Extent& s = world.size();
  world.fill_box({0, 0, 0}, {s.x, s.y, 1}, true);
  world.fill_box({0, 0, 0}, {1, s.y, s.z}, true);
  world.fill_box({0, 0, 0}, {s.x, 1, s.z}, true);
  for (int i = 0; i < 12; ++i) {
    const cuda::Extent low{world.below(s.x * 9 / 10), world.below(s.y * 9 / 10), 1};
    const cuda::Extent end{low.x + 24, low.y + 32, 1 + world.below(s.z)};
    world.fill_box(low, end, true);
    world.fill_box({low.x + 1, low.y + 1, 1}, {end.x - 1, end.y - 1, end.z - 1}, false);
  }
}

/// A whole grid transformed anew, with nothing to bring home.
void time_transform(int ordinal, const char* name, const edt_cuda::TransformSettings& settings) {
  auto transform = edt_cuda::make_device_transform(settings, ordinal);
  if (!transform) return fail_loudly(transform.error());
  edt_cuda::checks::World world(settings.size_vox, 3);
  furnish(world);
  const std::vector<std::int32_t> blocks = world.take_changed();
  Row row;
  for (int i = -2; i < kRepeats; ++i) {
    const auto rows = (*transform)->obstacle_rows(blocks.size());
    if (!rows) return fail_loudly(rows.error());
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      world.rows(blocks[b], rows->data() + b * cuda::kBlockRows);
    }
    Result<edt_cuda::ChangedDistances> done;
    const double waited = ms_of([&] { done = (*transform)->update(blocks); });
    if (!done) return fail_loudly(done.error());
    if (i < 0) continue;
    row.add((*transform)->times());
    row.waited.push_back(waited);
  }
  row.print(name);
}

/// A VGA frame in the host's memory to the changed blocks of the field back in it.
void time_frames(int ordinal, bool is_signed) {
  const cuda::Extent size{320, 320, 128};
  auto map = voxel_grid_cuda::make_device_map(map_settings(size), ordinal);
  auto transform = edt_cuda::make_device_transform({size, 1024, is_signed}, ordinal);
  if (!map) return fail_loudly(map.error());
  if (!transform) return fail_loudly(transform.error());
  DeviceScene scene(size, 0.025, 640, 480);
  std::vector<std::int32_t> blocks(20 * 20 * 8);
  std::iota(blocks.begin(), blocks.end(), 0);
  Row row;
  std::size_t changed_blocks = 0;
  for (int i = -5; i < kRepeats; ++i) {
    const auto frame = scene.image(i + 5);
    Result<edt_cuda::ChangedDistances> done;
    Result<voxel_grid_cuda::MapChange> seen;
    const double waited = ms_of([&] {
      seen = (*map)->integrate(frame);
      if (!seen) return;
      if (i > -5) blocks.assign(seen->blocks.begin(), seen->blocks.end());
      done = (*transform)->update(blocks, (*map)->occupancy(), false);
    });
    if (!seen) return fail_loudly(seen.error());
    if (!done) return fail_loudly(done.error());
    if (i < 0) continue;
    StageTimes both;
    for (std::size_t s = 0; s < cuda::kStages; ++s) {
      both.ms[s] = (*map)->times().ms[s] + (*transform)->times().ms[s];
    }
    row.add(both);
    row.waited.push_back(waited);
    changed_blocks += done->blocks.size();
  }
  row.print(is_signed ? "VGA frame, 320 x 320 x 128, 0.8 m, signed"
                      : "VGA frame, 320 x 320 x 128, 0.8 m");
  std::printf("(%zu changed blocks a frame)\n", changed_blocks / kRepeats);
}

/// The same frame as a cloud, its rays cast.
void time_clouds(int ordinal) {
  const cuda::Extent size{320, 320, 128};
  auto map = voxel_grid_cuda::make_device_map(map_settings(size), ordinal);
  if (!map) return fail_loudly(map.error());
  DeviceScene scene(size, 0.025, 640, 480);
  Row row;
  for (int i = -3; i < kRepeats; ++i) {
    const auto frame = scene.cloud(i + 3);
    Result<voxel_grid_cuda::MapChange> seen;
    const double waited = ms_of([&] { seen = (*map)->integrate(frame); });
    if (!seen) return fail_loudly(seen.error());
    if (i < 0) continue;
    row.add((*map)->times());
    row.waited.push_back(waited);
  }
  row.print("VGA cloud, rays cast");
}

}  // namespace

void print_times(int ordinal) {
  std::printf("Medians of %d, in ms.\n\n", kRepeats);
  std::printf("| | upload | integrate | transform | download | waited |\n");
  std::printf("| --- | --- | --- | --- | --- | --- |\n");
  const cuda::Extent paper{320, 320, 128};
  constexpr std::uint32_t kDiagonal = 320 * 320 + 320 * 320 + 128 * 128;
  time_transform(ordinal, "full, unsigned, no limit", {paper, kDiagonal, false});
  time_transform(ordinal, "full, signed, no limit", {paper, kDiagonal, true});
  time_transform(ordinal, "full, unsigned, 32 voxels", {paper, 1024, false});
  time_transform(ordinal, "full, signed, 32 voxels", {paper, 1024, true});
  time_transform(ordinal, "full, signed, 32 voxels, 704 x 704 x 128",
                 {{704, 704, 128}, 1024, true});
  time_clouds(ordinal);
  time_frames(ordinal, false);
  time_frames(ordinal, true);
}

}  // namespace sidestep::cuda_checks
