#include "view_feed.hpp"

#include <stdexcept>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "view_testing.hpp"

namespace sidestep {
namespace {

using testing_support::ball_field;
using testing_support::ball_world;
using testing_support::DecodedMap;
using testing_support::DecodedMessage;
using testing_support::ListeningSink;
using testing_support::map_at;
using testing_support::step_at;

class QuietLog final : public Log {
 public:
  void write(LogLevel, std::string_view message) override { last = message; }
  std::string last;
};

TEST(ViewFeed, HandsOverWhatSeveralThreadsTell) {
  QuietLog log;
  ListeningSink sink;
  ViewFeed feed({&sink}, log);
  feed.begin(ball_world());
  constexpr int kMaps = 200;
  std::thread mapping([&] {
    for (int i = 0; i < kMaps; ++i) feed.mapped(map_at(0.01 * i, i, ball_field({0.01 * i, 1, 1})));
  });
  std::thread planning([&] {
    for (int i = 0; i < 2000; ++i) {
      if (i % 100 == 0) feed.happened(testing_support::plan_at(0.001 * i));
      feed.stepped(step_at(0.001 * i));
    }
  });
  mapping.join();
  planning.join();
  feed.end({Stamp::from_seconds(2.0), true, "done"});
  feed.finish();
  ASSERT_FALSE(sink.messages.empty());
  EXPECT_EQ(sink.messages.front().kind, ViewKind::kWorld);
  EXPECT_EQ(sink.messages.back().kind, ViewKind::kEnd);
  DecodedMap page;
  for (const ViewMessage& message : sink.messages) {
    if (message.kind == ViewKind::kMap) page.apply(DecodedMessage(*message.bytes));
  }
  const double x_m = 0.01 * (kMaps - 1);
  const auto last = ball_field({x_m, 1, 1});
  for (int x = 0; x < 35; ++x) EXPECT_EQ(page.occupied(x, 5, 7), last->at({x, 5, 7}) <= 0.0F);
}

TEST(ViewFeed, RobotThatThrowsEndsTheShowNotTheRun) {
  struct ThrowingRobot final : RobotModel {
    testing_support::BallRobot ball{0.2};
    const RobotDescription& description() const noexcept override { return ball.description(); }
    void link_poses(std::span<const double>, std::span<Transform>, Scratch&) const override {
      throw std::runtime_error("no poses");
    }
    void sphere_centres(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                        Scratch& scratch) const override {
      ball.sphere_centres(q, centres_m, scratch);
    }
    void sphere_jacobians(std::span<const double>, std::span<Eigen::Vector3d>,
                          std::span<Eigen::Vector3d>, Scratch&) const override {}
    void pull_back(std::span<const double>, std::span<const LinkForce>, std::span<double>,
                   Scratch&) const override {}
  };
  QuietLog log;
  ListeningSink sink;
  ViewFeed feed({&sink}, log);
  ObservedWorld world = ball_world();
  world.robot = std::make_shared<const ThrowingRobot>();
  feed.begin(world);
  feed.finish();
  feed.stepped(step_at(1.0));  // goes on
  EXPECT_NE(log.last.find("no poses"), std::string::npos);
}

TEST(ViewFeed, WhatIsToldWhileNobodyReadsCostsNoMessage) {
  QuietLog log;
  ListeningSink sink;
  sink.wanted = {false, false, {}};
  {
    ViewFeed feed({&sink}, log);
    feed.begin(ball_world());
    for (int i = 0; i < 100; ++i) feed.stepped(step_at(0.1 * i));
  }
  EXPECT_TRUE(sink.messages.empty());
  EXPECT_TRUE(sink.greeting.empty());
}

}  // namespace
}  // namespace sidestep
