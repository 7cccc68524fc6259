#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <sidestep/core/log.hpp>
#include <sidestep/mapping/sensor_agreement.hpp>
#include <sidestep/mapping/sensor_check.hpp>
#include <sidestep/runtime/paced_frames.hpp>

namespace sidestep {

/// One of the sensors that see for a robot.
struct Sensor {
  Source& source;
  std::string name;       ///< As messages have it.
  bool is_needed = true;  ///< Whether the robot is to stop where it fails.
};

/// The frames of one or more sensors as one stream, each paced by the clock and watched for faults
/// (SensorCheck, and SensorAgreement of cameras with the last scan of a laser). Frames come in the
/// order of their stamps: one waits for those that were taken before it and take longer to come, as
/// the sensors' latencies have shown.
///
/// A sensor is missing while it is at fault, and once it has given no sound frame for kSilent_s, or
/// three of its periods. Without one that is needed, also before its first frame, none is passed
/// on, so that the map ages and the robot stops; without another one the rest goes on, and the log
/// says so. [mapping]
class SensorSet final : public Source {
 public:
  static constexpr double kSilent_s = 0.3;

  /// At least one sensor. `waits` as PacedFrames has it; floor and robot as SensorCheck has them.
  SensorSet(const std::vector<Sensor>& sensors, const Clock& clock, bool waits,
            std::optional<double> floor_z_m, const std::shared_ptr<const RobotModel>& robot,
            Log& log);

  /// Fails as PacedFrames does, with the sensor's name; of one alone with kBadFrame, in addition,
  /// while it is at fault. Of several, bad frames are left out, the first in a row told to the log,
  /// as is what comes after a later frame of another or more than 0.2 s late; with kBadFrame for
  /// any frame while a sensor that is needed is missing. One of several that fails for good is
  /// missing from then on; the failure of the last is passed on.
  [[nodiscard]] Result<std::optional<Frame>> next(const Deadline& deadline) override;
  [[nodiscard]] std::optional<std::int64_t> frame_count() const override;

  /// See PacedFrames; of all sensors together.
  [[nodiscard]] std::int64_t take_span() noexcept;
  [[nodiscard]] std::vector<CameraView> take_views();
  /// When the frame that was passed on last came.
  [[nodiscard]] Stamp received() const noexcept { return received_; }
  /// Whether to keep a copy of the last frame that was passed on.
  void keep_last(bool keeps) noexcept { keeps_last_ = keeps; }
  /// Null before the first one that was kept.
  [[nodiscard]] const std::shared_ptr<const Frame>& last() const noexcept { return last_; }

 private:
  struct Watched {
    PacedFrames frames;
    std::string name;
    bool is_needed;
    SensorCheck check;
    std::unique_ptr<Frame> pending = nullptr;
    Stamp received = {};            ///< When the last one came, the pending one if there is one.
    std::optional<Stamp> newest{};  ///< Of the sound ones.
    std::optional<Stamp> heard{};   ///< When that was received.
    double latency_s = 0.0;         ///< From stamp to receipt, as seen of late.
    double period_s = 0.0;          ///< From one sound frame to the next, a running mean.
    std::string trouble = {};       ///< Why its last frame was no good; empty: it was.
    bool is_at_fault = false;       ///< As SensorCheck has it.
    bool has_ended = false;
    bool is_missing = false;  ///< As the log has it.
  };

  /// Asks one sensor; fails as next() does.
  [[nodiscard]] Result<void> ask(Watched& sensor, const Deadline& deadline);
  /// The one whose frame is next, if its time has come.
  [[nodiscard]] Watched* due();
  [[nodiscard]] Result<std::optional<Frame>> pass_on(Watched& sensor);
  /// Of several: leaves out a frame.
  void leave_out(Watched& sensor, const Error& why);
  [[nodiscard]] bool is_missing(const Watched& sensor, Stamp now) const;
  [[nodiscard]] static std::string why_missing(const Watched& sensor);
  /// Tells of sensors that are missing, or are back; the first that is needed and missing.
  [[nodiscard]] const Watched* look_for_missing(Stamp now);

  const Clock& clock_;
  bool waits_;
  Log& log_;
  std::vector<Watched> sensors_;
  SensorAgreement agreement_;
  std::optional<Stamp> first_;  ///< Stamps of the first and the last that were passed on.
  Stamp passed_;
  Stamp received_;
  bool keeps_last_ = false;
  std::shared_ptr<const Frame> last_;
};

}  // namespace sidestep
