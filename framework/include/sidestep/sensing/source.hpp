#pragma once

#include <memory>
#include <optional>

#include <sidestep/core/error.hpp>
#include <sidestep/core/export.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/geometry/scene.hpp>
#include <sidestep/sensing/frame.hpp>

namespace sidestep {

/// Supplies frames: a camera, a recording, a simulation.
class SIDESTEP_EXPORT Source {
 public:
  virtual ~Source();

  /// The next frame, whose number and stamp are above those of the one before; nothing at the end
  /// of the stream, and from then on. Fails with kBadFrame, naming file and frame, where one frame
  /// is unusable: the caller may go on with the next call. Fails with kDeadlineExceeded where no
  /// frame came in time, with kCancelled where the caller's stop was requested, and with any other
  /// code for good. [mapping]; allocates.
  [[nodiscard]] virtual Result<std::optional<Frame>> next(const Deadline& deadline) = 0;

  /// How many frames there are in all, unusable ones included; nothing where it cannot be known.
  [[nodiscard]] virtual std::optional<std::int64_t> frame_count() const = 0;
};

/// Optional interface of a source: the exact scene behind its frames.
class SIDESTEP_EXPORT GroundTruth {
 public:
  virtual ~GroundTruth();
  /// The scene; frames are taken at scene time `frame.stamp.seconds()`. [any]
  [[nodiscard]] virtual const Scene& scene() const = 0;
  /// The same with the ways, up to a time, of people who see the robot. [mapping]
  [[nodiscard]] virtual std::shared_ptr<const Scene> scene_until(Stamp time);
};

}  // namespace sidestep
