#include "convex_model.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

constexpr std::size_t kMostLooks = 64;  ///< At points of one axis.

struct Look {
  double fraction;
  double distance_m;
};

/// What the distance between two looks cannot be less than, a way of length_m apart.
double least_between(const Look& a, const Look& b, double length_m) {
  const double apart_m = (b.fraction - a.fraction) * length_m;
  return std::min({a.distance_m, b.distance_m, 0.5 * (a.distance_m + b.distance_m - apart_m)});
}

}  // namespace

SweptContacts::SweptContacts(const Problem& problem)
    : problem_(&problem),
      floor_(problem.space, problem.robot->description()),
      spheres_(problem.robot->description().spheres.size()) {
  for (const CollisionSphere& sphere : problem.robot->description().spheres) {
    radius_m_.push_back(sphere.radius_m);
  }
}

const std::vector<SweptContact>& SweptContacts::find(const WaypointStates& states, double reach_m) {
  contacts_.clear();
  if (spheres_ == 0 || (!problem_->field && !problem_->space.floor)) return contacts_;
  look(states);
  for (int s = 0; s + 1 < states.states(); ++s) {
    for (std::size_t sphere = 0; sphere < spheres_; ++sphere) {
      if (problem_->field) sweep(s, sphere, reach_m);
      if (problem_->space.floor) drop(s, sphere, reach_m);
    }
  }
  return contacts_;
}

void SweptContacts::look(const WaypointStates& states) {
  const StateBatch all = states.everywhere();
  const std::size_t points = spheres_ * static_cast<std::size_t>(all.count);
  centres_m_.resize(points);
  distances_m_.assign(points, std::numeric_limits<double>::infinity());
  statuses_.resize(points);
  problem_->robot->sphere_centres(all.q, centres_m_, scratch_);
  if (problem_->field) {
    query_with_policy(*problem_->field, problem_->space, centres_m_, distances_m_, {}, statuses_);
  }
}

double SweptContacts::clearance_m(int state, std::size_t sphere) const {
  const std::size_t point = static_cast<std::size_t>(state) * spheres_ + sphere;
  return std::min(distances_m_[point] - radius_m_[sphere], floor_(sphere, centres_m_[point]));
}

/// Of a curve through equally spaced points, an eighth of its second difference is how far it is
/// from the chord half way.
double SweptContacts::departure_m(std::size_t point, std::size_t next) const {
  double bend_m = 0.0;
  for (const std::size_t p : {point, next}) {
    if (p < spheres_ || p + spheres_ >= centres_m_.size()) continue;
    const Eigen::Vector3d bend =
        centres_m_[p - spheres_] - 2.0 * centres_m_[p] + centres_m_[p + spheres_];
    bend_m = std::max(bend_m, bend.norm());
  }
  return bend_m / 8.0;
}

void SweptContacts::sweep(int state, std::size_t sphere, double reach_m) {
  const std::size_t from = static_cast<std::size_t>(state) * spheres_ + sphere;
  const std::size_t to = from + spheres_;
  const double length_m = (centres_m_[to] - centres_m_[from]).norm();
  const double bend_m = departure_m(from, to);
  const double lost_m = radius_m_[sphere] + bend_m;
  std::array<Look, kMostLooks> looks{{{0.0, distances_m_[from]}, {1.0, distances_m_[to]}}};
  std::size_t count = 2;
  const auto point_at = [&](double fraction) {
    return Eigen::Vector3d(centres_m_[from] + fraction * (centres_m_[to] - centres_m_[from]));
  };
  double least_m = 0.0;
  for (;;) {
    std::size_t worst = 0;
    least_m = std::numeric_limits<double>::infinity();
    double seen_m = least_m;
    for (std::size_t i = 0; i < count; ++i) {
      seen_m = std::min(seen_m, looks[i].distance_m);
      if (i + 1 == count) break;
      const double between_m = least_between(looks[i], looks[i + 1], length_m);
      if (between_m >= least_m) continue;
      least_m = between_m;
      worst = i;
    }
    if (!(least_m - lost_m < reach_m)) return;
    if (seen_m - least_m <= kSearch_m || count == kMostLooks) break;
    const double fraction = 0.5 * (looks[worst].fraction + looks[worst + 1].fraction);
    const Eigen::Vector3d point = point_at(fraction);
    double distance_m = 0.0;
    FieldStatus status{};
    query_with_policy(*problem_->field, problem_->space, {&point, 1}, {&distance_m, 1}, {},
                      {&status, 1});
    std::copy_backward(looks.begin() + static_cast<std::ptrdiff_t>(worst) + 1,
                       looks.begin() + static_cast<std::ptrdiff_t>(count),
                       looks.begin() + static_cast<std::ptrdiff_t>(count) + 1);
    looks[worst + 1] = {fraction, distance_m};
    ++count;
  }
  const Look& nearest =
      *std::min_element(looks.begin(), looks.begin() + static_cast<std::ptrdiff_t>(count),
                        [](const Look& a, const Look& b) { return a.distance_m < b.distance_m; });
  const Eigen::Vector3d point = point_at(nearest.fraction);
  SweptContact contact{
      state, sphere, nearest.fraction, least_m - lost_m, nearest.distance_m - least_m + bend_m, {}};
  double distance_m = 0.0;
  FieldStatus status{};
  query_with_policy(*problem_->field, problem_->space, {&point, 1}, {&distance_m, 1},
                    {&contact.normal, 1}, {&status, 1});
  contacts_.push_back(contact);
}

void SweptContacts::drop(int state, std::size_t sphere, double reach_m) {
  const std::size_t from = static_cast<std::size_t>(state) * spheres_ + sphere;
  const std::size_t to = from + spheres_;
  const double at_from_m = floor_(sphere, centres_m_[from]);
  const double at_to_m = floor_(sphere, centres_m_[to]);
  const double bend_m = departure_m(from, to);
  const double least_m = std::min(at_from_m, at_to_m) - bend_m;
  if (!(least_m < reach_m)) return;
  contacts_.push_back(
      {state, sphere, at_to_m < at_from_m ? 1.0 : 0.0, least_m, bend_m, Eigen::Vector3d::UnitZ()});
}

namespace {

/// A state depends on two waypoints before it and two after it.
constexpr int kBandReach = 3;

}  // namespace

ConvexModel::ConvexModel(const Problem& problem, const DifferenceMetric& metric,
                         double smoothness_weight, double keep_m, double reach_m)
    : problem_(&problem),
      metric_(&metric),
      smoothness_weight_(smoothness_weight),
      keep_m_(keep_m),
      reach_m_(reach_m),
      states_(problem),
      terms_(problem, {"obstacle", "floor", "start", "goal"}),
      swept_(problem),
      zeros_(metric.inner(), states_.dof(), kBandReach) {}

int ConvexModel::variable(int waypoint, int joint) const noexcept {
  const bool is_end = waypoint == 0 || waypoint + 1 == states_.waypoints();
  return is_end ? -1 : (waypoint - 1) * states_.dof() + joint;
}

double ConvexModel::keep_m(const SweptContact& contact) const {
  double keep = keep_m_;
  const auto no_more_than_at = [&](int state) {
    keep = std::min(keep, swept_.clearance_m(state, contact.sphere) - contact.slack_m);
  };
  if (contact.state < states_.step()) no_more_than_at(0);
  if (contact.state + states_.step() >= states_.states() - 1) no_more_than_at(states_.states() - 1);
  return keep;
}

Merit ConvexModel::evaluate(const Waypoints& positions) {
  states_.update(positions);
  Merit merit;
  std::vector<double> costs(idx(states_.states()));
  terms_.add_costs(states_, costs);
  for (const double cost : costs) merit.cost += cost;
  merit.cost += smoothness_weight_ * metric_->cost(positions);
  for (const SweptContact& contact : swept_.find(states_, keep_m_)) {
    const double lacks_m = std::max(0.0, keep_m(contact) - contact.clearance_m);
    merit.shortfall_m += lacks_m;
    merit.worst_m = std::max(merit.worst_m, lacks_m);
  }
  return merit;
}

PenaltyQp ConvexModel::convexify(const Waypoints& positions, double penalty) {
  states_.update(positions);
  PenaltyQp qp{zeros_, Eigen::VectorXd::Zero(zeros_.size()), {}, {}, {}};
  add_smoothness(positions, qp);
  add_terms(qp);
  add_contacts(penalty, qp);
  return qp;
}

void ConvexModel::add_smoothness(const Waypoints& positions, PenaltyQp& qp) const {
  const int d = states_.dof();
  Waypoints gradient = Waypoints::Zero(positions.rows(), positions.cols());
  metric_->add_gradient(positions, smoothness_weight_, gradient);
  qp.g += gradient.middleCols(1, metric_->inner()).reshaped();
  const Eigen::SparseMatrix<double>& a = metric_->a();
  for (int column = 0; column < a.outerSize(); ++column) {
    for (Eigen::SparseMatrix<double>::InnerIterator it(a, column); it; ++it) {
      if (it.row() < column) continue;
      for (int j = 0; j < d; ++j) {
        qp.h.add(static_cast<int>(it.row()) * d + j, column * d + j,
                 smoothness_weight_ * metric_->joint_weights()[j] * it.value());
      }
    }
  }
}

void ConvexModel::add_terms(PenaltyQp& qp) {
  (void)terms_.linearise(states_, normals_);
  const int d = states_.dof();
  Eigen::MatrixXd hessian(2 * d, 2 * d);
  Eigen::VectorXd gradient(2 * d);
  for (int s = 0; s < states_.states(); ++s) {
    const bool has_position = normals_.has_position(idx(s)), has_full = normals_.has_full(idx(s));
    if (!has_position && !has_full) continue;
    hessian.setZero();
    gradient.setZero();
    const auto add = [&](const StateNormals::Block& block, int width, std::size_t stride) {
      const Eigen::OuterStride<> columns(static_cast<Eigen::Index>(stride));
      hessian.topLeftCorner(width, width) +=
          Eigen::Map<const Eigen::MatrixXd, 0, Eigen::OuterStride<>>(block.hessian, width, width,
                                                                     columns);
      gradient.head(width) += Eigen::Map<const Eigen::VectorXd>(block.gradient, width);
    };
    if (has_position) add(normals_.position(idx(s)), d, normals_.position_stride());
    if (has_full) add(normals_.full(idx(s)), 2 * d, normals_.full_stride());
    for (const auto& a : states_.shares(s)) {
      for (int i = 0; i < d; ++i) {
        const int row = variable(a.waypoint, i);
        if (row < 0) continue;
        qp.g[row] += a.of_q * gradient[i] + a.of_qdot * gradient[d + i];
        for (const auto& b : states_.shares(s)) {
          for (int j = 0; j < d; ++j) {
            const int column = variable(b.waypoint, j);
            if (column < 0 || column > row) continue;
            qp.h.add(
                row, column,
                a.of_q * (b.of_q * hessian(i, j) + b.of_qdot * hessian(i, d + j)) +
                    a.of_qdot * (b.of_q * hessian(d + i, j) + b.of_qdot * hessian(d + i, d + j)));
          }
        }
      }
    }
  }
}

void ConvexModel::add_contacts(double penalty, PenaltyQp& qp) {
  const auto& contacts = swept_.find(states_, reach_m_);
  const std::size_t d = idx(states_.dof());
  for (const int end : {0, 1}) {
    forces_.clear();
    for (const SweptContact& contact : contacts) {
      const int link = problem_->robot->description().spheres[contact.sphere].link;
      forces_.push_back(
          {contact.state + end, link, contact.normal,
           swept_.centre_m(contact.state + end, contact.sphere).cross(contact.normal)});
    }
    rows_[end].resize(contacts.size() * d);
    problem_->robot->pull_back(states_.everywhere().q, forces_, rows_[end], scratch_);
  }
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    const SweptContact& contact = contacts[k];
    const int first = std::max(1, contact.state / states_.step() - 1);
    const int last = std::min(first + kBandReach, states_.waypoints() - 2);
    if (first > last) continue;
    Hinge hinge{variable(first, 0), std::vector<double>(idx(last - first + 1) * d),
                keep_m(contact) - contact.clearance_m, penalty};
    for (const int end : {0, 1}) {
      const double part = end == 0 ? 1.0 - contact.fraction : contact.fraction;
      for (const auto& share : states_.shares(contact.state + end)) {
        if (share.waypoint < first || share.waypoint > last) continue;
        double* to = &hinge.coefficients[idx(share.waypoint - first) * d];
        for (std::size_t j = 0; j < d; ++j) to[j] += part * share.of_q * rows_[end][k * d + j];
      }
    }
    qp.hinges.push_back(std::move(hinge));
  }
}

}  // namespace sidestep
