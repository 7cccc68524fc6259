// A gaze: the head looks whoever is nearest in the eye.

#include "eye_contact.hpp"

namespace eye_contact {
namespace {

using namespace sidestep;

class EyeContact final : public Gaze {
 public:
  explicit EyeContact(const Options& options) : options_(options) {}

  /// The loop has a tracker only where something asks for it.
  bool wants_tracks() const noexcept override { return true; }

  Result<HeadAngles> look(const GazeRequest& request) override {
    const HeadAngles rest = request.head.rest();
    if (request.tracks == nullptr) return rest;  // before the first map
    const Eigen::Vector3d camera_m =
        request.head.T_world_camera(request.at, request.T_world_link).translation();
    // Tracks are of the newest frame, which is a while ago.
    const double age_s = request.now.seconds() - request.tracks->stamp.seconds();
    HeadAngles to = rest;
    double nearest_m = options_.within_m;
    for (const Track& track : request.tracks->tracks) {
      const Eigen::Vector2d at_m = track.position_m + age_s * track.velocity_mps;
      const Eigen::Vector3d eyes_m(at_m.x(), at_m.y(), track.top_m - options_.below_top_m);
      const double away_m = (eyes_m - camera_m).norm();
      if (!(away_m < nearest_m)) continue;
      // The host would leave the head as it is: look at somebody else instead.
      const HeadAngles towards = request.head.towards(eyes_m, request.T_world_link, request.at);
      if (!request.may(towards)) continue;
      to = towards;
      nearest_m = away_m;
    }
    return to;
  }

 private:
  Options options_;
};

}  // namespace

Result<std::unique_ptr<Gaze>> create(const Options& options, const HostContext&) {
  return std::make_unique<EyeContact>(options);
}

}  // namespace eye_contact

SIDESTEP_PLUGIN(sidestep::Gaze, eye_contact::Options, eye_contact::create, "eye_contact", "0.1.0",
                "The head looks at whoever is nearest: an example of a plugin")
