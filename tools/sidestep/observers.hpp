#pragma once

#include <memory>
#include <vector>

#include <sidestep/runtime/run_observer.hpp>

#include "commands.hpp"
#include "run_recorder.hpp"
#include "view_feed.hpp"

namespace sidestep {

/// Several who look on, told one after the other.
class RunObservers final : public RunObserver {
 public:
  /// `observer` outlives this.
  void add(RunObserver& observer) { observers_.push_back(&observer); }
  [[nodiscard]] bool empty() const noexcept { return observers_.empty(); }

  void begin(const ObservedWorld& world) override;
  void mapped(const ObservedMap& map) override;
  void stepped(const ObservedStep& step) override;
  void happened(const ObservedEvent& event) override;
  void end(const ObservedEnd& end) override;

 private:
  std::vector<RunObserver*> observers_;
};

/// Who looks on at one run.
class AttachedObservers {
 public:
  /// For an ExperimentContext; null where nobody looks on.
  [[nodiscard]] RunObserver* get() noexcept { return all_.empty() ? nullptr : &all_; }

 private:
  friend Result<std::unique_ptr<AttachedObservers>> attach_observers(const RunOptions& options,
                                                                     LiveView* live, Log& log);
  std::unique_ptr<RunRecorder> recorder_;
  std::unique_ptr<ViewFeed> feed_;
  RunObservers all_;
};

/// Makes those that `options` ask for; they end with the object that holds them. Fails with kConfig
/// where the file to record into exists, with kIo where it cannot be made. `live`, the viewer, may
/// be null; it and `log` outlive them.
[[nodiscard]] Result<std::unique_ptr<AttachedObservers>> attach_observers(const RunOptions& options,
                                                                          LiveView* live, Log& log);

}  // namespace sidestep
