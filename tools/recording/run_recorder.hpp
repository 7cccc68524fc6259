#pragma once

#include <exception>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include <sidestep/core/log.hpp>
#include <sidestep/runtime/run_observer.hpp>

#include "record_queue.hpp"
#include "run_bag.hpp"
#include "view_feed.hpp"

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

/// Records a run as a ROS bag while it goes on. What the robot's threads call only queues what they
/// hand over; a thread of low priority makes messages of it and writes them. Where the disk is too
/// slow, depth images are given up first and events never; the run is never held up.
class RunRecorder final : public RunObserver {
 public:
  static constexpr std::size_t kMostQueued_bytes = std::size_t{256} << 20;

  /// Begins a new file. Fails with kInvalidArgument where there is one already, with kIo where it
  /// cannot be made, naming file and reason. What goes wrong later is told to `log`, once, and ends
  /// the recording; `log` outlives the recorder. [main]
  [[nodiscard]] static Result<std::unique_ptr<RunRecorder>> start(
      const std::filesystem::path& file, Log& log,
      std::size_t most_queued_bytes = kMostQueued_bytes);
  /// finish()
  ~RunRecorder() override;

  void begin(const ObservedWorld& world) override;
  void mapped(const ObservedMap& map) override;
  void stepped(const ObservedStep& step) override;
  void happened(const ObservedEvent& event) override;
  void end(const ObservedEnd& end) override;

  /// Writes what is left, and ends the file; tells the log what was given up. [main]
  void finish();

 private:
  struct Seen {
    std::shared_ptr<const Frame> frame;
    Stamp received;
  };
  /// Without its frame, which may have been given up.
  struct Mapped {
    ObservedMap map;
  };
  using Item = std::variant<ObservedWorld, Seen, Mapped, ObservedStep, ObservedEvent, ObservedEnd>;

  RunRecorder(RunBag bag, std::filesystem::path file, Log& log, std::size_t most_queued_bytes);
  void work();
  void write(const Item& item);
  void write_map(ObservedMap map);
  void tell_fault();
  void tell_loss(const std::exception& exception) noexcept;

  RecordQueue<Item> queue_;
  std::filesystem::path file_;
  Log& log_;
  /// These three of the thread alone, while there is one.
  RunBag bag_;
  ViewRecorder view_;
  std::shared_ptr<const Frame> newest_frame_;
  bool has_told_fault_ = false;
  std::jthread thread_;
};

}  // namespace sidestep
