#pragma once

#include <condition_variable>
#include <mutex>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include <sidestep/core/log.hpp>

#include "view_maker.hpp"

namespace sidestep {

/// Looks on while a run goes on, and hands what it sees to sinks. What the robot's threads call
/// leaves pointers in an inbox and returns; a thread of low priority makes messages of them, at its
/// own pace, and nothing while nobody reads.
class ViewFeed final : public RunObserver {
 public:
  /// Starts the thread. Sinks and log outlive the feed.
  ViewFeed(std::vector<ViewSink*> sinks, Log& log, const ViewRates& rates = {});
  ~ViewFeed() override;

  void begin(const ObservedWorld& world) override { inbox_.begin(world); }
  void mapped(const ObservedMap& map) override { inbox_.mapped(map); }
  void stepped(const ObservedStep& step) override { inbox_.stepped(step); }
  void happened(const ObservedEvent& event) override { inbox_.happened(event); }
  void end(const ObservedEnd& end) override { inbox_.end(end); }

  /// Hands over what is left, and ends the thread. [main]
  void finish();

 private:
  void work(const std::stop_token& stop);
  bool make_once();

  ViewInbox inbox_;
  ViewMaker maker_;
  Log& log_;
  std::chrono::nanoseconds period_;
  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::jthread thread_;
};

}  // namespace sidestep
