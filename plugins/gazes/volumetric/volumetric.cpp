#include <vector>

#include <sidestep/plugin/plugin.hpp>

#include "views.hpp"

namespace {

using namespace sidestep;

struct Options {
  double ahead_s = 1.0;
  double horizon_s = 10.0;
  double stale_s = 3.0;
  double range_m = 4.5;
  int pans = 16;
  int tilts = 9;

  static Parameters<Options> parameters() {
    using O = Options;
    return Parameters<O>()
        .add("ahead_s", &O::ahead_s, "What the robot sweeps from then on counts.",
             {.unit = "s", .min = 0.0, .max = 60.0})
        .add("horizon_s", &O::horizon_s, "Until then.", {.unit = "s", .min = 0.1, .max = 60.0})
        .add("stale_s", &O::stale_s, "What was not looked at for so long is to be seen again.",
             {.unit = "s", .min = 0.0, .max = 60.0})
        .add("range_m", &O::range_m, "How far the camera sees.",
             {.unit = "m", .min = 0.1, .max = 100.0})
        .add("pans", &O::pans, "Directions of the pan joint.", {.min = 1, .max = 64})
        .add("tilts", &O::tilts, "Directions of the tilt joint.", {.min = 1, .max = 64});
  }
};

/// The greedy gaze of Finean, Merkt and Havoutis, "Where Should I Look?" (RA-L 2022): the direction
/// that shows most of the volume swept ahead that is unseen or stale.
class Volumetric final : public Gaze {
 public:
  explicit Volumetric(const Options& options) : options_(options), looked_at_(options.range_m) {}

  [[nodiscard]] Result<HeadAngles> look(const GazeRequest& request) override {
    looked_at_.note(request);
    const std::vector<Place> places = swept_places(request, options_.ahead_s, options_.horizon_s);
    if (places.empty() || request.field == nullptr) return request.at;
    const Sight sight(request);
    std::vector<float> worths(places.size());
    for (std::size_t k = 0; k < places.size(); ++k) {
      const Eigen::Vector3d& p_m = places[k].p_m;
      double distance_m = 0.0;
      FieldStatus status{};
      request.field->query({&p_m, 1}, {&distance_m, 1}, {}, {&status, 1});
      const bool is_wanted =
          status != FieldStatus::kKnown || looked_at_.age_s(p_m, request.now) > options_.stale_s;
      worths[k] = is_wanted && sight.reaches(p_m) ? 1.0F : 0.0F;
    }
    const Directions directions(request, options_.pans, options_.tilts, places, worths,
                                options_.range_m);
    std::size_t best = 0;
    float most = 0.0F;
    for (std::size_t d = 0; d < directions.size(); ++d) {
      const float worth = directions.worth(d, worths);
      if (worth <= most) continue;
      best = d;
      most = worth;
    }
    return directions.angles(best);
  }

 private:
  Options options_;
  LookedAt looked_at_;
};

Result<std::unique_ptr<Gaze>> create(const Options& options, const HostContext&) {
  return std::make_unique<Volumetric>(options);
}

}  // namespace

SIDESTEP_PLUGIN(Gaze, Options, create, "volumetric", "0.1.0",
                "The head looks where most of what the robot will sweep is unseen or stale")
