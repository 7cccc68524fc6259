// One source for six plugins that load, and throw once they run: THROWING_SOURCE, THROWING_MAPPER
// and so on. The parameter `throws_in` names the method that throws; the others do not.
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <thread>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/mapping/dense_field_publisher.hpp>
#include <sidestep/planning/residual_names.hpp>
#include <sidestep/plugin/map_options.hpp>
#include <sidestep/plugin/plugin.hpp>
#include <sidestep/robot/kinematic_tree.hpp>

namespace {

using namespace sidestep;

/// What a plugin can do to the process that it is in.
[[maybe_unused]] int fill_stack(volatile int* below) {
  volatile int more[1000];
  more[0] = below[0] + 1;
  return fill_stack(more) + more[0];
}
void throw_in_vain() { throw std::runtime_error("nobody catches this"); }
void crash() { *static_cast<volatile int*>(nullptr) = 1; }

void harm_process(const std::string& method, const std::string& how) {
  if (how == "segv") crash();
  if (how == "worker") {
    WorkerPool workers(2);
    workers.run(64, [caller = std::this_thread::get_id()](int) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
      if (std::this_thread::get_id() != caller) crash();
    });
  }
  if (how == "fpe") std::raise(SIGFPE);
  if (how == "abort") std::abort();
  if (how == "overflow") {
    volatile int none[1] = {0};
    std::exit(fill_stack(none));
  }
  if (how == "terminate") []() noexcept { throw_in_vain(); }();
  if (how == "thread") std::thread(&throw_in_vain).join();
  if (how == "exit") std::exit(0);
  if (how == "_exit") _exit(0);
  if (how == "quick_exit") std::quick_exit(0);
  if (how == "killed") std::raise(SIGKILL);
  if (how == "hang") {
    std::fprintf(stderr, "hanging in %s\n", method.c_str());
    for (;;) std::this_thread::sleep_for(std::chrono::hours(1));
  }
}

/// Throws in the method that was asked for; of `METHOD:HOW`, does that to its process.
class Fuse {
 public:
  explicit Fuse(std::string throws_in) : throws_in_(std::move(throws_in)) {}
  void pass(const std::string& method) const {
    if (method == throws_in_) throw std::runtime_error("on fire in " + method);
    if (throws_in_.starts_with(method + ":"))
      harm_process(method, throws_in_.substr(method.size() + 1));
  }

 private:
  std::string throws_in_;
};

#if defined(THROWING_SOURCE)

using Kind = Source;

/// Takes the simulator's parameters, and hands out two walls.
struct Options {
  std::string throws_in;
  Node scene, frames, camera, camera_path;
  static Parameters<Options> parameters() {
    using O = Options;
    return Parameters<O>()
        .add("throws_in", &O::throws_in, "Method.")
        .add("scene", &O::scene, "Not used.")
        .add("frames", &O::frames, "Not used.")
        .add("camera", &O::camera, "Not used.")
        .add("camera_path", &O::camera_path, "Not used.");
  }
};

class Throwing final : public Source, public GroundTruth {
 public:
  explicit Throwing(const Options& options) : fuse_(options.throws_in) {}

  Result<std::optional<Frame>> next(const Deadline&) override {
    fuse_.pass("next");
    if (at_ == 2) return std::optional<Frame>();
    Frame frame;
    frame.sequence = at_++;
    frame.T_world_camera.translation() = Eigen::Vector3d(0.0, 0.0, 1.0);
    frame.measurement = DepthImage{{4, 4, 4.0, 4.0, 1.5, 1.5}, std::vector<float>(16, 1.0F)};
    return std::optional<Frame>(std::move(frame));
  }
  std::optional<std::int64_t> frame_count() const override {
    fuse_.pass("frame_count");
    return 2;
  }
  const Scene& scene() const override {
    fuse_.pass("scene");
    return scene_;
  }

 private:
  Fuse fuse_;
  Scene scene_;
  std::int64_t at_ = 0;
};

Result<std::unique_ptr<Source>> create(const Options& options, const HostContext&) {
  return std::make_unique<Throwing>(options);
}

#elif defined(THROWING_MAPPER)

using Kind = Mapper;

struct Options : MapOptions {
  std::string throws_in;
  static Parameters<Options> parameters() {
    return declare_grid(Parameters<Options>()).add("throws_in", &Options::throws_in, "Method.");
  }
};

/// Never sees anything.
class Throwing final : public Mapper, public OccupancyView {
 public:
  explicit Throwing(const Options& options)
      : fuse_(options.throws_in),
        grid_(options.grid()),
        words_per_row_((grid_.size_vox.x() + 63) / 64),
        words_(static_cast<std::size_t>(words_per_row_ * grid_.size_vox.y() * grid_.size_vox.z())) {
  }

  Result<MapUpdate> integrate(const Frame& frame) override {
    fuse_.pass("integrate");
    return fail(ErrorCode::kUnsupported, "has seen enough",
                "frame " + std::to_string(frame.sequence));
  }
  const GridSpec& grid() const noexcept override { return grid_; }
  const GridSpec& occupancy_grid() const noexcept override { return grid_; }
  VoxelBits occupied() const noexcept override { return {words_, words_per_row_}; }
  VoxelBits known() const noexcept override { return {words_, words_per_row_}; }

 private:
  Fuse fuse_;
  GridSpec grid_;
  int words_per_row_;
  std::vector<std::uint64_t> words_;
};

Result<std::unique_ptr<Mapper>> create(const Options& options, const HostContext&) {
  return std::make_unique<Throwing>(options);
}

#elif defined(THROWING_FIELD)

using Kind = FieldBuilder;

struct Options {
  std::string throws_in;
  std::string unknown;
  static Parameters<Options> parameters() {
    return Parameters<Options>()
        .add("throws_in", &Options::throws_in, "Method.")
        .add("unknown", &Options::unknown, "Not used.");
  }
};

class Throwing final : public FieldBuilder {
 public:
  explicit Throwing(const Options& options) : fuse_(options.throws_in) {}

  Result<void> attach(Mapper&) override {
    fuse_.pass("attach");
    return {};
  }
  Result<std::shared_ptr<const DistanceField>> update(const MapUpdate&) override {
    fuse_.pass("update");
    return fail(ErrorCode::kUnsupported, "has nothing to say");
  }

 private:
  Fuse fuse_;
};

Result<std::unique_ptr<FieldBuilder>> create(const Options& options, const HostContext&) {
  return std::make_unique<Throwing>(options);
}

#elif defined(THROWING_ROBOT)

using Kind = RobotModel;

struct Options {
  std::string throws_in;
  static Parameters<Options> parameters() {
    return Parameters<Options>().add("throws_in", &Options::throws_in, "Method.");
  }
};

/// A ball in the plane.
class Throwing final : public RobotModel {
 public:
  Throwing(const Options& options, std::unique_ptr<KinematicTree> tree)
      : fuse_(options.throws_in), tree_(std::move(tree)) {}

  const RobotDescription& description() const noexcept override { return tree_->description(); }
  void link_poses(std::span<const double> q, std::span<Transform> T_world_link,
                  Scratch& scratch) const override {
    fuse_.pass("link_poses");
    tree_->link_poses(q, T_world_link, scratch);
  }
  void sphere_centres(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                      Scratch& scratch) const override {
    fuse_.pass("sphere_centres");
    tree_->sphere_centres(q, centres_m, scratch);
  }
  void sphere_jacobians(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                        std::span<Eigen::Vector3d> jacobians, Scratch& scratch) const override {
    fuse_.pass("sphere_jacobians");
    tree_->sphere_jacobians(q, centres_m, jacobians, scratch);
  }
  void pull_back(std::span<const double> q, std::span<const LinkForce> forces,
                 std::span<double> joint_forces, Scratch& scratch) const override {
    fuse_.pass("pull_back");
    tree_->pull_back(q, forces, joint_forces, scratch);
  }

 private:
  Fuse fuse_;
  std::unique_ptr<KinematicTree> tree_;
};

Result<std::unique_ptr<RobotModel>> create(const Options& options, const HostContext&) {
  RobotDescription robot;
  robot.name = "throwing";
  robot.links = {{"world", -1}, {"slide", 0}, {"body", 1}};
  std::vector<TreeJoint> joints(3);
  joints[0].name = "root";
  for (const std::size_t i : {0U, 1U}) {
    const std::string name = i == 0 ? "x" : "y";
    robot.joints.push_back({name, Joint::Type::kPrismatic, -10.0, 10.0, 1.0, 1.0});
    joints[i + 1].name = name;
    joints[i + 1].motion = TreeJoint::Motion::kTranslation;
    joints[i + 1].axis = Eigen::Vector3d::Unit(static_cast<int>(i));
    joints[i + 1].joint = static_cast<int>(i);
  }
  Transform T_body_ball = Transform::Identity();
  T_body_ball.translation().z() = 0.3;
  robot.spheres = {{2, {0.0, 0.0, 0.3}, 0.1}};
  robot.shapes = {{2, Sphere{0.1}, T_body_ball}};
  auto tree = KinematicTree::create(std::move(robot), std::move(joints));
  if (!tree) return tl::make_unexpected(std::move(tree.error()));
  return std::make_unique<Throwing>(options, std::move(*tree));
}

#elif defined(THROWING_OPTIMISER)

using Kind = Optimiser;

struct Options {
  std::string throws_in;
  static Parameters<Options> parameters() {
    return Parameters<Options>().add("throws_in", &Options::throws_in, "Method.");
  }
};

class Throwing final : public Optimiser {
 public:
  explicit Throwing(const Options& options) : fuse_(options.throws_in) {}

  Result<Solution> solve(const Problem&, const Trajectory&, const Deadline&) override {
    fuse_.pass("solve");
    return fail(ErrorCode::kInvalidArgument, "does not like the problem");
  }

 private:
  Fuse fuse_;
};

Result<std::unique_ptr<Optimiser>> create(const Options& options, const HostContext&) {
  return std::make_unique<Throwing>(options);
}

#elif defined(THROWING_COST)

using Kind = StateCost;

struct Options {
  std::string throws_in;
  static Parameters<Options> parameters() {
    return Parameters<Options>().add("throws_in", &Options::throws_in, "Method.");
  }
};

class Throwing final : public StateCost, public NamesResiduals {
 public:
  explicit Throwing(const Options& options) : fuse_(options.throws_in) {}

  std::string_view name() const noexcept override { return "throwing"; }
  int residual_count() const noexcept override { return 1; }
  bool depends_on_velocity() const noexcept override { return false; }
  void evaluate(const StateBatch&, const CostBatch& out, Scratch&) const override {
    fuse_.pass("evaluate");
    for (const auto& values : {out.residuals, out.jacobian_q, out.jacobian_qdot}) {
      std::fill(values.begin(), values.end(), 0.0);
    }
  }
  double linearise(const StateBatch&, const StateRange&, StateNormals&, Scratch&) const override {
    fuse_.pass("linearise");
    return 0.0;
  }
  ResidualName residual_name(int) const override { return {"nothing", "", "", "m", 1.0}; }

 private:
  Fuse fuse_;
};

Result<std::unique_ptr<StateCost>> create(const Options& options, const HostContext&) {
  return std::make_unique<Throwing>(options);
}

#endif

}  // namespace

SIDESTEP_PLUGIN(Kind, Options, create, "throwing", "1", "Throws on request", OccupancyView)
