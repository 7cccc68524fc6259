#include <benchmark/benchmark.h>

#include "conformance/gaze_conformance.hpp"
#include "support/host_fixture.hpp"
#include "support/hsr.hpp"

namespace sidestep {
namespace {

/// The HSR on a way of 3 m that reaches down to the floor, among some balls and two people.
conformance::Looker hsr_on_its_way() {
  conformance::Looker looker(testing_support::load_hsr());
  const RobotDescription& robot = looker.robot()->description();
  const auto pose = [&](const char* name, double x_m) {
    Eigen::VectorXd q = Eigen::VectorXd::Zero(robot.dof());
    const auto& positions = robot.find_pose(name)->positions;
    for (int j = 0; j < q.size(); ++j) q[j] = positions[idx(j)].value_or(0.0);
    q[0] = x_m;
    return q;
  };
  looker.stand(pose("go", 0.0));
  looker.drive_to(pose("reach_floor", 3.0), 25.0);
  std::vector<conformance::Ball> balls;
  for (int i = 0; i < 8; ++i) balls.push_back({{0.5 * i, i % 2 == 0 ? 1.2 : -1.2, 0.5}, 0.3});
  looker.field = std::make_shared<conformance::BallField>(balls);
  Tracks tracks{{}, looker.now};
  for (const double y_m : {-1.0, 1.5}) {
    Track& track = tracks.tracks.emplace_back();
    track.id = static_cast<std::int64_t>(tracks.tracks.size());
    track.position_m = {1.5, y_m};
    track.top_m = 1.8;
    track.last_seen = {looker.now.ns - 500'000'000};
  }
  looker.tracks = tracks;
  return looker;
}

void look(benchmark::State& state, const std::string& block) {
  testing_support::HostFixture fixture({PLUGIN_FOLDER});
  const auto gaze = fixture.host.create<Gaze>(testing_support::HostFixture::block(block),
                                              RunLoan{testing_support::load_hsr()});
  conformance::Looker looker = hsr_on_its_way();
  for (auto _ : state) {
    looker.now.ns += 100'000'000;
    looker.take_frame();
    const auto angles = (*gaze)->look(looker.request());
    benchmark::DoNotOptimize(angles);
    looker.at = looker.head().within_limits(*angles);
  }
}

BENCHMARK_CAPTURE(look, foresight, "{plugin: foresight}")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(look, volumetric, "{plugin: volumetric}")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(look, look_ahead, "{plugin: look_ahead, link: hand_palm_link}")
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace sidestep
