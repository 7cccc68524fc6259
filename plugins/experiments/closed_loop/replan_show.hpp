#pragma once

#include <string>

#include <sidestep/runtime/run_observer.hpp>

#include "replan_mapping.hpp"
#include "replan_types.hpp"
#include "replan_world.hpp"

namespace sidestep {

/// Shows an episode to the observer, if there is one: the world first, its end last.
/// [planning], but for begin() and end(), which are [main].
class EpisodeShow {
 public:
  /// `observer` may be null: then nothing is shown. All must outlive it.
  EpisodeShow(RunObserver* observer, const ReplanWorld& world, EpisodeMapping& mapping)
      : observer_(observer), world_(world), mapping_(mapping) {}

  /// What is mapped from now on is shown, too.
  void begin(const std::string& title, std::int64_t episode) const;
  /// `record` is that of the episode so far.
  void step(Stamp now, double step_ms, Replanner::Status status, const Replanner& replanner,
            const EpisodeRecord& record) const;
  /// A stop is followed, too: every event is shown with what is followed after it.
  void event(const EpisodeEvent& event, const Replanner& replanner) const;
  void end(const EpisodeRecord& record) const;

 private:
  RunObserver* observer_;
  const ReplanWorld& world_;
  EpisodeMapping& mapping_;
};

}  // namespace sidestep
