#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "chain_scene.hpp"
#include "device_checks.hpp"

namespace sidestep::cuda_checks {
namespace {

using gp_chain_cuda::BatchOutcome;
using gp_chain_cuda::ChainBatch;
using gp_chain_cuda::ChainState;
using gp_chain_cuda::MinimisationRules;
using gp_chain_cuda::Standing;
using gp_chain_cuda::test::ChainScene;

/// Shows a batch the scene and begins it; returns what went wrong.
std::string begin(ChainBatch& batch, const ChainScene& scene,
                  const std::vector<gp_chain_cuda::ChainStart>& starts,
                  const MinimisationRules& rules) {
  if (auto ok = batch.set_field(scene.shape(), scene.blocks()); !ok) return ok.error().message;
  if (auto ok = batch.begin(scene.description(), rules, starts, scene.samples()); !ok) {
    return ok.error().message;
  }
  return {};
}

std::string different(double tested, double expected, double tolerance) {
  if (std::abs(tested - expected) <= tolerance * expected) return {};
  return std::to_string(tested) + " instead of " + std::to_string(expected);
}

std::string different(const ChainState& tested, const ChainState& expected) {
  // Sines differ in their last digit from the host's.
  std::string wrong = different(tested.initial_cost, expected.initial_cost, 1e-9);
  if (!wrong.empty()) return "an initial cost of " + wrong;
  if (tested.standing != Standing::kConverged) return "it has not converged";
  wrong = different(tested.cost, expected.cost, 1e-4);
  return wrong.empty() ? wrong : "a cost of " + wrong;
}

/// Batches on the device and on the host.
std::string same_chains(int ordinal, int turning) {
  ChainScene scene(turning, 14, 3, {96, 80, 32});
  for (int i = 0; i < 24; ++i) scene.add_start(i);
  auto device = gp_chain_cuda::make_device_batch(ordinal);
  auto host = gp_chain_cuda::make_host_batch(cuda::HostBackend());
  if (!device || !host) return device ? host.error().message : device.error().message;
  for (ChainBatch* batch : {device->get(), host->get()}) {
    if (auto wrong = begin(*batch, scene, scene.starts(), {}); !wrong.empty()) return wrong;
    auto moving = batch->move(0);
    while (moving && *moving > 0) moving = batch->move(2);
    if (!moving) return moving.error().message;
  }
  const auto tested = (*device)->outcome();
  const auto expected = (*host)->outcome();
  if (!tested || !expected) return "no outcome";
  int obstructed = 0;
  for (std::size_t i = 0; i < tested->states.size(); ++i) {
    const std::string wrong = different(tested->states[i], expected->states[i]);
    if (!wrong.empty()) return "chain " + std::to_string(i) + ": " + wrong;
    const auto terms = (*device)->term_costs(static_cast<int>(i));
    const auto same = (*host)->term_costs(static_cast<int>(i));
    if (!terms || !same) return "no costs of terms";
    double sum = 0.0;
    for (const double cost : *terms) sum += cost;
    if (auto off = different(sum, tested->states[i].cost, 1e-9); !off.empty()) {
      return "terms whose sum is " + off;
    }
    obstructed += (*terms)[3] > 0.0 ? 1 : 0;
  }
  return obstructed > 0 ? "" : "no chain met an obstacle";
}

/// More than any device has: an error that says so, and the device is as usable as before.
std::string chains_too_many(int ordinal) {
  ChainScene scene(6, 60000, 2, {16, 16, 16});
  scene.add_start(0);
  auto device = gp_chain_cuda::make_device_batch(ordinal);
  if (!device) return device.error().message;
  const std::vector<gp_chain_cuda::ChainStart> starts(2000, scene.starts().front());
  if (auto ok = (*device)->set_field(scene.shape(), scene.blocks()); !ok) return "no field";
  const auto begun = (*device)->begin(scene.description(), {}, starts, scene.samples());
  if (begun) return "a terabyte of chains was begun";
  if (begun.error().code != ErrorCode::kUnsupported) return begun.error().message;
  if (begun.error().message.find("MiB") == std::string::npos) return "the error names no size";
  return same_chains(ordinal, 4);
}

double ms_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin)
      .count();
}

struct ChainTimes {
  double field_ms = 0.0, upload_ms = 0.0, minimise_ms = 0.0, download_ms = 0.0, waited_ms = 0.0;
  int launches = 0;
};

/// One batch, from trajectories in the host's memory to those found back in it.
std::string time_batch(ChainBatch& batch, const ChainScene& scene, bool is_in_one_launch,
                       ChainTimes& times) {
  const auto starts = scene.starts();
  const auto begun = std::chrono::steady_clock::now();
  const MinimisationRules rules{{1e-2, 1e-5, 50}, 0.01};
  if (auto ok = batch.begin(scene.description(), rules, starts, scene.samples()); !ok) {
    return ok.error().message;
  }
  times = {};
  times.upload_ms = batch.times().of(cuda::Stage::kUpload);
  Result<int> moving = 1;
  while (moving && *moving > 0) {
    moving = batch.move(is_in_one_launch ? rules.stop.max_iterations : 1);
    times.minimise_ms += batch.times().of(cuda::Stage::kTransform);
    ++times.launches;
  }
  if (!moving) return moving.error().message;
  const auto outcome = batch.outcome();
  if (!outcome) return outcome.error().message;
  times.download_ms = batch.times().of(cuda::Stage::kDownload);
  times.waited_ms = ms_since(begun);
  return {};
}

}  // namespace

std::vector<Check> chain_checks(int ordinal) {
  return {{"trajectories as on the host, 8 joints", [=] { return same_chains(ordinal, 6); }},
          {"trajectories as on the host, 12 joints", [=] { return same_chains(ordinal, 10); }},
          {"trajectories beyond the device's memory", [=] { return chains_too_many(ordinal); }}};
}

void print_chain_times(int ordinal) {
  constexpr int kRepeats = 11;
  auto device = gp_chain_cuda::make_device_batch(ordinal);
  if (!device) return;
  std::printf(
      "\n| trajectories of 8 joints, 20 states, 4 checks | upload | minimise | download | ");
  std::printf("waited | launches |\n| --- | --- | --- | --- | --- | --- |\n");
  for (const int chains : {1, 64, 1024, 4096}) {
    ChainScene scene(6, 20, 4, {160, 160, 64});
    for (int i = 0; i < chains; ++i) scene.add_start(i);
    if (auto ok = (*device)->set_field(scene.shape(), scene.blocks()); !ok) {
      std::printf("FAILED: %s\n", ok.error().message.c_str());
      return;
    }
    for (const bool is_in_one_launch : {false, true}) {
      std::vector<ChainTimes> all;
      for (int i = -2; i < kRepeats; ++i) {
        ChainTimes times;
        const std::string wrong = time_batch(**device, scene, is_in_one_launch, times);
        if (!wrong.empty()) {
          std::printf("FAILED: %s\n", wrong.c_str());
          return;
        }
        if (i >= 0) all.push_back(times);
      }
      std::ranges::nth_element(all, all.begin() + kRepeats / 2, {}, &ChainTimes::waited_ms);
      const ChainTimes& median = all[kRepeats / 2];
      std::printf("| %d | %.3f | %.3f | %.3f | %.3f | %d |\n", chains, median.upload_ms,
                  median.minimise_ms, median.download_ms, median.waited_ms, median.launches);
    }
  }
}

}  // namespace sidestep::cuda_checks
