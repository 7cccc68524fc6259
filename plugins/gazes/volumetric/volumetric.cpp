#include <vector>

#include <sidestep/plugin/plugin.hpp>

#include "views.hpp"

namespace {

using namespace sidestep;

struct Options : ViewOptions {
  double ahead_s = 1.0;

  Options() { stale_s = 3.0; }
  static Parameters<Options> parameters() {
    return declare_views<Options>().add("ahead_s", &Options::ahead_s,
                                        "What the robot sweeps from then on counts.",
                                        {.unit = "s", .min = 0.0, .max = 60.0});
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
      const bool is_wanted =
          !sight.knows(p_m) || looked_at_.age_s(p_m, request.now) > options_.stale_s;
      worths[k] = is_wanted && sight.reaches(p_m) ? 1.0F : 0.0F;
    }
    const Directions directions(request, options_, places, worths);
    std::size_t best = 0;
    float most = 0.0F;
    for (std::size_t d = 0; d < directions.size(); ++d) {
      const float worth = directions.worth(d, worths);
      if (worth <= most || !request.may(directions.angles(d))) continue;
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
