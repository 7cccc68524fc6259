#include <optional>

#include <sidestep/plugin/plugin.hpp>

namespace {

using namespace sidestep;

struct Options {
  std::optional<double> pan_rad;
  std::optional<double> tilt_rad;

  static Parameters<Options> parameters() {
    return Parameters<Options>()
        .add("pan_rad", &Options::pan_rad, "Where the pan joint stays; without, where it rests.",
             {.unit = "rad"})
        .add("tilt_rad", &Options::tilt_rad, "Where the tilt joint stays; without, where it rests.",
             {.unit = "rad"});
  }
};

/// The head stays where it is told to.
class Fixed final : public Gaze {
 public:
  explicit Fixed(const Options& options) : options_(options) {}
  [[nodiscard]] Result<HeadAngles> look(const GazeRequest& request) override {
    const HeadAngles rest = request.head.rest();
    return HeadAngles{options_.pan_rad.value_or(rest.pan_rad),
                      options_.tilt_rad.value_or(rest.tilt_rad)};
  }

 private:
  Options options_;
};

Result<std::unique_ptr<Gaze>> create(const Options& options, const HostContext&) {
  return std::make_unique<Fixed>(options);
}

}  // namespace

SIDESTEP_PLUGIN(Gaze, Options, create, "fixed", "0.1.0", "The head stays as it is told to")
