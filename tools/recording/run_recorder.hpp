#pragma once

#include <filesystem>
#include <memory>
#include <thread>
#include <variant>
#include <vector>

#include <sidestep/core/log.hpp>
#include <sidestep/runtime/run_observer.hpp>

#include "record_queue.hpp"
#include "run_bag.hpp"
#include "view_recorder.hpp"

namespace sidestep {

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
