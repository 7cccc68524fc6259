#include <cmath>
#include <string>
#include <vector>

#include <sidestep/core/index.hpp>
#include <sidestep/plugin/plugin.hpp>

namespace {

using namespace sidestep;

/// A link that moves no farther than this stays here.
constexpr double kHere_m = 0.1;

struct Options {
  std::string link;
  double ahead_s = 2.0;

  static Parameters<Options> parameters() {
    return Parameters<Options>()
        .add("link", &Options::link, "The link that is looked at.", {.required = true})
        .add("ahead_s", &Options::ahead_s, "How much later, along the way of the robot.",
             {.unit = "s", .min = 0.0, .max = 600.0});
  }
};

/// Looks at where a link will be; while that is where it is, the head stays.
class LookAhead final : public Gaze {
 public:
  LookAhead(const Options& options, int link) : options_(options), link_(idx(link)) {}

  [[nodiscard]] Result<HeadAngles> look(const GazeRequest& request) override {
    const Eigen::Vector3d here_m = request.T_world_link[link_].translation();
    const Eigen::Vector3d there_m = later_m(request).value_or(here_m);
    const bool is_far = (there_m - here_m).norm() > kHere_m;
    if (is_far || !wanted_) {
      wanted_ = request.head.towards(there_m, request.T_world_link, request.at);
    }
    return *wanted_;
  }

 private:
  [[nodiscard]] std::optional<Eigen::Vector3d> later_m(const GazeRequest& request) {
    if (request.way == nullptr) return {};
    q_.resize(idx(request.way->dof));
    request.way->sample(request.way_from_s + options_.ahead_s, q_, {});
    T_world_link_.resize(request.T_world_link.size());
    request.robot.link_poses(q_, T_world_link_, scratch_);
    return T_world_link_[link_].translation();
  }

  Options options_;
  std::size_t link_;
  std::optional<HeadAngles> wanted_;
  std::vector<double> q_;
  std::vector<Transform> T_world_link_;
  Scratch scratch_;
};

Result<std::unique_ptr<Gaze>> create(const Options& options, const HostContext& context) {
  if (context.robot == nullptr) {
    return fail(ErrorCode::kUnsupported, "there is no robot that could look anywhere");
  }
  const RobotDescription& robot = context.robot->description();
  if (const auto link = robot.link_index(options.link)) {
    return std::make_unique<LookAhead>(options, *link);
  }
  std::vector<std::string> names;
  for (const Link& link : robot.links) names.push_back(link.name);
  return fail(ErrorCode::kConfig, "robot '" + robot.name + "' has no link '" + options.link + "'",
              {}, did_you_mean(options.link, names));
}

}  // namespace

SIDESTEP_PLUGIN(Gaze, Options, create, "look_ahead", "0.1.0",
                "The head looks at where a link of the robot will be")
