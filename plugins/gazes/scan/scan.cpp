#include <algorithm>
#include <cmath>

#include <sidestep/plugin/plugin.hpp>

namespace {

using namespace sidestep;

struct Options {
  double speed_radps = 1.1;
  double tilt_rad = -0.7853981633974483;
  double reach_rad = 1.5707963267948966;

  static Parameters<Options> parameters() {
    return Parameters<Options>()
        .add("speed_radps", &Options::speed_radps, "How fast the head pans, if it can.",
             {.unit = "rad/s", .min = 1e-3, .max = 10.0})
        .add("tilt_rad", &Options::tilt_rad, "How far it is tilted.", {.unit = "rad"})
        .add("reach_rad", &Options::reach_rad, "How far it pans to either side, within its limits.",
             {.unit = "rad", .min = 0.0, .max = 3.141592653589793});
  }
};

/// Pans from side to side.
class Scan final : public Gaze {
 public:
  explicit Scan(const Options& options) : options_(options) {}
  [[nodiscard]] Result<HeadAngles> look(const GazeRequest& request) override {
    const Joint& pan = request.head.description().pan.joint;
    const double right_rad = std::max(-options_.reach_rad, pan.lower);
    const double width_rad = std::max(0.0, std::min(options_.reach_rad, pan.upper) - right_rad);
    if (!begun_) begun_ = request.now;
    // A triangular wave, from the middle on.
    const double way_rad =
        options_.speed_radps * 1e-9 * static_cast<double>(request.now.ns - begun_->ns) +
        0.5 * width_rad;
    const double along_rad = std::fmod(way_rad, std::max(2.0 * width_rad, 1e-9));
    return HeadAngles{right_rad + (along_rad < width_rad ? along_rad : 2.0 * width_rad - along_rad),
                      options_.tilt_rad};
  }

 private:
  Options options_;
  std::optional<Stamp> begun_;
};

Result<std::unique_ptr<Gaze>> create(const Options& options, const HostContext&) {
  return std::make_unique<Scan>(options);
}

}  // namespace

SIDESTEP_PLUGIN(Gaze, Options, create, "scan", "0.1.0", "The head pans from side to side")
