#pragma once

#include <functional>
#include <memory>
#include <string>

#include <sidestep/runtime/run_observer.hpp>

#include "view_maker.hpp"

namespace sidestep {

/// Makes the messages that a page would be sent of a run, at the pace of the run's clock rather
/// than the wall's: a recording shows a run in simulated time as smoothly as one that took its
/// time. [one thread]
class ViewRecorder final : private ViewSink {
 public:
  /// `made`: the time of the episode at which a page would have been sent the message.
  using Write = std::function<void(Stamp made, const std::string& message)>;

  explicit ViewRecorder(Write write) : write_(std::move(write)), maker_({this}) {}

  void begin(const ObservedWorld& world);
  void mapped(const ObservedMap& map);
  void stepped(const ObservedStep& step);
  void happened(const ObservedEvent& event);
  void end(const ObservedEnd& end);

 private:
  /// Makes what is due at a time of the episode.
  void make(Stamp stamp);

  Demand demand() override { return {true, false, {}}; }  // It is there from the beginning.
  void greet(const std::vector<ViewMessage>&) override {}
  void publish(const ViewMessage& message) override { write_(made_, *message.bytes); }
  void publish_slice(const SliceRequest&, const ViewMessage&) override {}

  Write write_;
  ViewInbox inbox_;
  ViewMaker maker_;
  Stamp made_;
  ViewMaker::TimePoint begin_, last_;  ///< Of this episode: its time 0, and the latest so far.
};

}  // namespace sidestep
