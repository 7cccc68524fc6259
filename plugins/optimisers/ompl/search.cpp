#include "search.hpp"

#include <algorithm>
#include <memory>
#include <utility>

#include <ompl/base/MotionValidator.h>
#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <Eigen/Core>

namespace sidestep::ompl_optimiser {
namespace {

constexpr double kLeastLever_m = 0.02;  // per rad

}  // namespace

std::vector<double> weights_of(const Problem& problem, const JointMetric& metric) {
  const std::vector<Joint>& joints = problem.robot->description().joints;
  std::vector<double> weights;
  if (metric.name == "motion") {
    weights = joint_paths::motion_weights(problem, kLeastLever_m);
    double fastest = 0.0;
    for (std::size_t j = 0; j < joints.size(); ++j) {
      fastest = std::max(fastest, weights[j] * joints[j].max_velocity);
    }
    for (double& weight : weights) weight /= fastest;
  } else {
    for (const Joint& joint : joints) weights.push_back(1.0 / joint.max_velocity);
  }
  for (std::size_t j = 0; metric.weights.is_map() && j < joints.size(); ++j) {
    if (const Node* given = metric.weights.find(joints[j].name)) {
      weights[j] = given->as_double().value();
    }
  }
  return weights;
}

Result<void> check_weights(const JointMetric& metric, const RobotDescription& robot) {
  if (!metric.weights.is_map()) return {};
  std::vector<std::string> names;
  for (const Joint& joint : robot.joints) names.push_back(joint.name);
  for (const Node::Entry& entry : metric.weights.entries()) {
    if (std::ranges::find(names, entry.key) != names.end()) continue;
    return fail(ErrorCode::kInvalidArgument,
                "weights names the joint '" + entry.key + "', which " + robot.name + " has not", {},
                did_you_mean(entry.key, names));
  }
  return {};
}

namespace ob = ::ompl::base;

Search::Search(JointSpace space, Checker& checker, const Deadline& deadline)
    : space_(std::move(space)),
      checker_(checker),
      deadline_(deadline),
      q_from_(space_.dof()),
      q_to_(space_.dof()) {}

bool Search::is_clear(const ob::State* state) {
  const std::scoped_lock lock(mutex_);
  to_joints(state, q_from_);
  return checker_.is_clear(q_from_);
}

bool Search::is_clear(const ob::State* from, const ob::State* to, double resolution_m) {
  if (deadline_.expired()) return false;  // nothing more is to be found
  const std::scoped_lock lock(mutex_);
  way_.look(space_.steering(), values(from), values(to));
  const std::size_t dof = space_.dof();
  space_.to_joints(way_.vertices().first(dof), q_from_);
  for (std::size_t i = dof; i < way_.vertices().size(); i += dof) {
    space_.to_joints(way_.vertices().subspan(i, dof), q_to_);
    if (!checker_.is_clear(q_from_, q_to_, resolution_m)) return false;
    std::swap(q_from_, q_to_);
  }
  return true;
}

std::span<const double> Search::values(const ob::State* state) const {
  return {state->as<ob::RealVectorStateSpace::StateType>()->values, space_.dof()};
}

void Search::to_joints(const ob::State* state, std::span<double> q) const {
  space_.to_joints(values(state), q);
}

void Search::from_joints(std::span<const double> q, ob::State* state) const {
  double* u = state->as<ob::RealVectorStateSpace::StateType>()->values;
  space_.from_joints(q, {u, space_.dof()});
}

namespace {

constexpr int kLastValidHalvings = 6;

/// A vector space without projections, if possible: making them takes longer than many a search.
/// What is between two states is where the robot gets from one to the other.
class JointStates final : public ob::RealVectorStateSpace {
 public:
  JointStates(const joint_paths::JointSpace& joints, bool is_projected)
      : ob::RealVectorStateSpace(static_cast<unsigned>(joints.dof())),
        steering_(joints.steering()),
        is_projected_(is_projected) {}
  void registerProjections() override {
    if (is_projected_) ob::RealVectorStateSpace::registerProjections();
  }
  /// The length of the way; of a straight one the same number as the base's, without waiting for
  /// each joint's sum. Planners that extend a tree step by step want what is nearer to be so along
  /// the way.
  double distance(const ob::State* a, const ob::State* b) const override {
    if (!steering_.is_straight()) return way_between(a, b).length();
    const auto count = static_cast<Eigen::Index>(dimension_);
    const Eigen::Map<const Eigen::VectorXd> from(a->as<StateType>()->values, count);
    const Eigen::Map<const Eigen::VectorXd> to(b->as<StateType>()->values, count);
    return (to - from).norm();
  }

  void interpolate(const ob::State* from, const ob::State* to, double part,
                   ob::State* between) const override {
    if (steering_.is_straight()) {
      return ob::RealVectorStateSpace::interpolate(from, to, part, between);
    }
    way_between(from, to).at(part, values(between));
  }
  /// The way round by another state may be shorter.
  bool isMetricSpace() const override { return steering_.is_straight(); }

 private:
  [[nodiscard]] std::span<double> values(const ob::State* state) const {
    return {state->as<StateType>()->values, dimension_};
  }
  [[nodiscard]] joint_paths::Way way_between(const ob::State* from, const ob::State* to) const {
    joint_paths::Way way;
    way.look(steering_, values(from), values(to));
    return way;
  }

  joint_paths::Steering steering_;
  bool is_projected_;
};

class ClearStates final : public ob::StateValidityChecker {
 public:
  ClearStates(ob::SpaceInformation* information, Search& search, bool is_left_to_motions)
      : ob::StateValidityChecker(information),
        search_(search),
        is_left_to_motions_(is_left_to_motions) {}
  using ob::StateValidityChecker::isValid;
  bool isValid(const ob::State* state) const override {
    return si_->satisfiesBounds(state) && (is_left_to_motions_ || search_.is_clear(state));
  }

 private:
  Search& search_;
  bool is_left_to_motions_;
};

class ClearMotions final : public ob::MotionValidator {
 public:
  ClearMotions(ob::SpaceInformation* information, Search& search, double resolution_m)
      : ob::MotionValidator(information), search_(search), resolution_m_(resolution_m) {}

  bool checkMotion(const ob::State* from, const ob::State* to) const override {
    const bool is_clear = si_->satisfiesBounds(to) && search_.is_clear(from, to, resolution_m_);
    ++(is_clear ? valid_ : invalid_);
    return is_clear;
  }

  bool checkMotion(const ob::State* from, const ob::State* to,
                   std::pair<ob::State*, double>& last_valid) const override {
    if (checkMotion(from, to)) return true;
    ob::State* part = si_->allocState();
    double clear = 0.0;
    double step = 0.5;
    for (int i = 0; i < kLastValidHalvings; ++i, step *= 0.5) {
      si_->getStateSpace()->interpolate(from, to, clear + step, part);
      if (si_->satisfiesBounds(part) && search_.is_clear(from, part, resolution_m_)) clear += step;
    }
    si_->freeState(part);
    last_valid.second = clear;
    if (last_valid.first != nullptr) {
      si_->getStateSpace()->interpolate(from, to, clear, last_valid.first);
    }
    return false;
  }

 private:
  Search& search_;
  double resolution_m_;
};

}  // namespace

ob::SpaceInformationPtr make_information(Search& search, const SearchSettings& settings) {
  const JointSpace& joints = search.space();
  auto space = std::make_shared<JointStates>(joints, settings.is_projected);
  ob::RealVectorBounds bounds(static_cast<unsigned>(joints.dof()));
  for (std::size_t j = 0; j < joints.dof(); ++j) {
    // A joint whose range is a point still needs a little width for OMPL.
    bounds.setLow(static_cast<unsigned>(j), joints.lower(j));
    bounds.setHigh(static_cast<unsigned>(j), std::max(joints.upper(j), joints.lower(j) + 1e-9));
  }
  space->setBounds(bounds);
  auto information = std::make_shared<ob::SpaceInformation>(space);
  information->setStateValidityChecker(
      std::make_shared<ClearStates>(information.get(), search, settings.checks_motions_to_states));
  information->setMotionValidator(
      std::make_shared<ClearMotions>(information.get(), search, settings.resolution_m));
  information->setup();
  return information;
}

}  // namespace sidestep::ompl_optimiser
