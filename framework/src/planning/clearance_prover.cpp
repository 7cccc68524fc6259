#include "clearance_prover.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <optional>
#include <utility>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

const double kSqrt3 = std::sqrt(3.0);
/// More open gaps than this in one motion are not worth halving: the motion is absurd.
constexpr std::size_t kMaxGaps = std::size_t{1} << 18;
/// Voxels whose status is remembered; a power of two.
constexpr std::size_t kRemembered = 4096;
/// Levers are taken anew after about this much motion.
constexpr double kPiece_m = 0.3;
constexpr int kMaxPieces = 1 << 14;
/// By which a sphere that leaves an obstacle has to rise, of its way.
constexpr double kRise = 0.5;
/// A gap whose box has more voxels is halved: the boxes of its halves have a quarter together.
constexpr int kMaxVoxels = 64;

}  // namespace

struct ClearanceProver::Interval {
  double begin = 0.0;
  double end = 0.0;
  std::size_t first_gap = 0;
  std::size_t last_gap = 0;  // one past
};

struct ClearanceProver::Gap {
  int item = 0;
  ClearanceReading a;
  ClearanceReading b;
};

struct ClearanceProver::Measurement {
  int row = 0;  // of the batch of configurations
  int item = 0;
  ClearanceReading reading;
};

struct ClearanceProver::Workspace {
  bool keeps_to_observed = true;  // as the request says
  std::vector<Interval> intervals;
  std::vector<Gap> gaps;
  std::vector<Interval> next_intervals;
  std::vector<Gap> next_gaps;
  std::vector<Measurement> measurements;
  std::vector<double> times;
  std::vector<double> q;  // one row per time
  std::vector<double> piece_times;
  std::vector<ClearanceReading> piece_ends;  // all items at each of piece_times
  std::optional<double> read_to;             // the last of piece_times
  std::vector<double> variation;
  std::vector<double> levers;  // spheres x dof
  std::vector<Eigen::Vector3d> jacobians;
  std::vector<Eigen::Vector3d> centres;
  std::vector<Eigen::Vector3d> points;
  std::vector<double> distances;
  std::vector<FieldStatus> statuses;
  std::vector<std::size_t> targets;  // measurement or voxel of each point
  /// By voxel number modulo kRemembered: the voxels last found known, by number + 1.
  std::vector<std::size_t> known_voxels = std::vector<std::size_t>(kRemembered, 0);
  Scratch scratch;
};

ClearanceProver::WorkspacePtr ClearanceProver::make_workspace() const {
  return std::make_shared<Workspace>();
}

ClearanceProver::ClearanceProver(std::shared_ptr<const RobotModel> robot,
                                 std::shared_ptr<const MotionBounds> bounds,
                                 std::shared_ptr<const DistanceField> field, SpacePolicy space,
                                 double margin_m, bool obstacles_only)
    : robot_(std::move(robot)),
      field_(std::move(field)),
      dense_(dynamic_cast<const DenseField*>(field_.get())),
      space_(std::move(space)),
      above_floor_(space_, robot_->description()),
      margin_m_(margin_m),
      bounds_(std::move(bounds)) {
  const RobotDescription& description = robot_->description();
  sphere_count_ = static_cast<int>(description.spheres.size());
  if (!obstacles_only) pair_count_ = static_cast<int>(description.self_collision_pairs.size());
  spheres_of_link_.resize(description.links.size());
  const FieldInfo& info = field_->info();
  for (int s = 0; s < sphere_count_; ++s) {
    const CollisionSphere& sphere = description.spheres[idx(s)];
    spheres_of_link_[idx(sphere.link)].push_back(s);
    radius_m_.push_back(sphere.radius_m);
    keeps_to_observed_.push_back(
        space_.observed &&
        std::ranges::find(space_.observed->links, description.links[idx(sphere.link)].name) !=
            space_.observed->links.end());
    // In a cell that touches an occupied voxel the interpolant is at most one diagonal.
    const bool is_beyond_surface =
        info.is_exact ||
        sphere.radius_m + margin_m_ - leaving_depth_m(s) >= kSqrt3 * info.grid.resolution_m;
    fall_factor_.push_back(info.is_signed && !is_beyond_surface ? 2.0 : 1.0);
  }
  if (!space_.counts_fixed) fixed_ = fixed_spheres(*robot_);
  largest_levers_.assign(description.joints.size(), 0.0);
  for (int item = 0; item < item_count(); ++item) {
    const auto levers = item < sphere_count_ ? bounds_->sphere_levers(item)
                                             : bounds_->pair_levers(item - sphere_count_);
    for (std::size_t j = 0; j < levers.size(); ++j) {
      largest_levers_[j] = std::max(largest_levers_[j], levers[j]);
    }
  }
}

bool ClearanceProver::is_at_limit(int item, const ClearanceReading& reading) const noexcept {
  constexpr double kRounding_m = 1e-5;  // of a field of floats
  const double limit_m = field_->info().max_distance_m - radius_m_[idx(item)];
  return reading.clearance_m >= limit_m - kRounding_m && reading.clearance_m < reading.floor_m;
}

double ClearanceProver::way_bound_m(std::span<const double> variation) const noexcept {
  return std::inner_product(variation.begin(), variation.end(), largest_levers_.begin(), 0.0);
}

double ClearanceProver::way_m(int item, const Workspace& w) const noexcept {
  const std::size_t dof = w.variation.size();
  const std::span<const double> row = item < sphere_count_
                                          ? std::span(w.levers).subspan(idx(item) * dof, dof)
                                          : bounds_->pair_levers(item - sphere_count_);
  double sum = 0.0;
  for (std::size_t j = 0; j < dof; ++j) {
    if (w.variation[j] != 0.0) sum += row[j] * w.variation[j];
  }
  return sum;
}

double ClearanceProver::longest_way_m(const Workspace& w) const noexcept {
  double longest = 0.0;
  for (int item = 0; item < item_count(); ++item) longest = std::max(longest, way_m(item, w));
  return longest;
}

double ClearanceProver::fall_m(int item, double way_m) const noexcept {
  if (item >= sphere_count_) return way_m;
  const double allowed_m = leaving_depth_m(item) > 0.0 ? kRise * way_m : 0.0;
  if (field_->info().is_exact) return way_m + allowed_m;
  return fall_factor_[idx(item)] *
             std::min(kSqrt3 * way_m, way_m + kSqrt3 * field_->info().grid.resolution_m) +
         allowed_m;
}

double ClearanceProver::leaving_depth_m(int item) const noexcept {
  return space_.leaving != nullptr ? space_.leaving->depths_m[idx(item)] : 0.0;
}

/// How much deeper than others a sphere may be that leaves an obstacle.
double ClearanceProver::allowance_m(int item, const Eigen::Vector3d& centre_m) const noexcept {
  const double depth_m = leaving_depth_m(item);
  if (depth_m <= 0.0) return 0.0;
  const double way_m = (centre_m - space_.leaving->centres_m[idx(item)]).norm();
  return std::max(std::min(depth_m, margin_m_), depth_m - kRise * way_m);
}

bool ClearanceProver::violates(int item, const ClearanceReading& reading) const noexcept {
  if (!(reading.clearance_m >= required_m(item))) return true;
  return reading.is_unseen ||
         (reading.status == FieldStatus::kOutside && space_.outside == Space::kOccupied);
}

void ClearanceProver::measure(Workspace& w) const {
  if (w.measurements.empty()) return;
  const std::size_t rows = idx(w.measurements.back().row) + 1;
  w.centres.resize(rows * idx(sphere_count_));
  robot_->sphere_centres(w.q, w.centres, w.scratch);
  measure_spheres(w);
  measure_pairs(w);
}

void ClearanceProver::measure_spheres(Workspace& w) const {
  const FieldInfo& info = field_->info();
  w.points.clear();
  w.targets.clear();
  for (std::size_t m = 0; m < w.measurements.size(); ++m) {
    const Measurement& measurement = w.measurements[m];
    if (measurement.item >= sphere_count_) continue;
    w.points.push_back(
        w.centres[idx(measurement.row) * idx(sphere_count_) + idx(measurement.item)]);
    w.targets.push_back(m);
  }
  w.distances.resize(w.points.size());
  w.statuses.resize(w.points.size());
  query_with_policy(*field_, space_, w.points, w.distances, {}, w.statuses);
  for (std::size_t i = 0; i < w.points.size(); ++i) {
    Measurement& measurement = w.measurements[w.targets[i]];
    const double radius_m = radius_m_[idx(measurement.item)];
    ClearanceReading& reading = measurement.reading;
    if (!fixed_.empty() && fixed_[idx(measurement.item)]) {
      constexpr double kFar_m = 1e3;
      reading.clearance_m = reading.smooth_m = kFar_m;
      reading.inside_m = kFar_m;
      reading.centre_m = w.points[i];
      continue;
    }
    const double allowance_m = this->allowance_m(measurement.item, w.points[i]);
    reading.clearance_m = w.distances[i] - radius_m + allowance_m;
    reading.smooth_m = reading.clearance_m;
    reading.status = w.statuses[i];
    reading.is_unseen =
        reading.status == FieldStatus::kUnknown &&
        must_be_known(measurement.item, info.grid.centre_m(info.grid.voxel_at(w.points[i])), w);
    if (reading.is_unseen) reading.clearance_m = std::min(reading.clearance_m, -radius_m);
    reading.centre_m = w.points[i];
    reading.inside_m = info.grid.inside_m(w.points[i]);
    if (reading.status == FieldStatus::kOutside && space_.outside == Space::kFree) {
      double smooth_m = 0.0;
      field_->query({&w.points[i], 1}, {&smooth_m, 1}, {}, {});
      reading.smooth_m = smooth_m - radius_m + allowance_m;
    }
    reading.floor_m = above_floor_(idx(measurement.item), w.points[i]);
    reading.clearance_m = std::min(reading.clearance_m, reading.floor_m);  // the field's NaN stays
  }
}

void ClearanceProver::measure_pairs(Workspace& w) const {
  const auto& pairs = robot_->description().self_collision_pairs;
  for (Measurement& measurement : w.measurements) {
    if (measurement.item < sphere_count_) continue;
    const auto [first, second] = pairs[idx(measurement.item - sphere_count_)];
    const Eigen::Vector3d* centres = w.centres.data() + idx(measurement.row) * idx(sphere_count_);
    double nearest_m = kInfinity;
    for (const int a : spheres_of_link_[idx(first)]) {
      for (const int b : spheres_of_link_[idx(second)]) {
        const double radii_m = radius_m_[idx(a)] + radius_m_[idx(b)];
        const double squared = (centres[a] - centres[b]).squaredNorm();
        const double beaten_m = nearest_m + radii_m;
        if (beaten_m > 0.0 && squared < beaten_m * beaten_m) {
          nearest_m = std::sqrt(squared) - radii_m;
        }
      }
    }
    measurement.reading.clearance_m = nearest_m;
    measurement.reading.smooth_m = nearest_m;
  }
}

void ClearanceProver::read(std::span<const double> q, std::span<ClearanceReading> readings,
                           Workspace& w) const {
  w.keeps_to_observed = true;
  w.q.assign(q.begin(), q.end());
  w.measurements.clear();
  for (int item = 0; item < item_count(); ++item) w.measurements.push_back({0, item, {}});
  measure(w);
  for (std::size_t i = 0; i < w.measurements.size(); ++i) readings[i] = w.measurements[i].reading;
}

Shortfall ClearanceProver::shortfall(int item, const ClearanceReading& a, const ClearanceReading& b,
                                     double way_m, Workspace& w) const {
  const double in_field_m = field_shortfall_m(item, a, b, way_m, w);
  const double above_floor_m = 0.5 * (a.floor_m + b.floor_m - way_m);
  const double to_floor_m = required_m(item) - above_floor_m;
  return to_floor_m > in_field_m ? Shortfall(to_floor_m, true) : Shortfall(in_field_m);
}

double ClearanceProver::field_shortfall_m(int item, const ClearanceReading& a,
                                          const ClearanceReading& b, double way_m,
                                          Workspace& w) const {
  const double clear_m = 0.5 * (a.smooth_m + b.smooth_m - fall_m(item, way_m));
  const double shortfall = required_m(item) - clear_m;
  if (item >= sphere_count_) return shortfall;
  if (space_.outside == Space::kFree) {
    if (0.5 * (a.inside_m + b.inside_m + way_m) < 0.0) return 0.0;  // never comes inside
  } else {
    const double inside_m = 0.5 * (a.inside_m + b.inside_m - way_m);
    if (!(inside_m > 0.0)) return std::max(shortfall, way_m);
  }
  if (!(shortfall <= 0.0) || !keeps_to_known(item, w)) return shortfall;
  return stays_known(item, a, b, way_m, w) ? shortfall : way_m;
}

bool ClearanceProver::keeps_to_known(int item, const Workspace& w) const noexcept {
  return space_.unknown == Space::kOccupied ||
         (w.keeps_to_observed && keeps_to_observed_[idx(item)]);
}

bool ClearanceProver::must_be_known(int item, const Eigen::Vector3d& voxel_m,
                                    const Workspace& w) const noexcept {
  if (space_.unknown == Space::kOccupied) return true;
  if (!keeps_to_known(item, w)) return false;
  return (voxel_m.head<2>() - space_.observed->start_m).norm() > space_.observed->start_radius_m;
}

bool ClearanceProver::stays_known(int item, const ClearanceReading& a, const ClearanceReading& b,
                                  double way_m, Workspace& w) const {
  const GridSpec& grid = field_->info().grid;
  const Eigen::Vector3d middle = 0.5 * (a.centre_m + b.centre_m);
  const double radius_m = 0.5 * way_m;
  if (!(radius_m < kMaxVoxels * grid.resolution_m)) return false;
  const Eigen::Array3d last_voxel = grid.size_vox.cast<double>().array() - 1.0;
  const auto voxel_near = [&](double shift_m) -> Eigen::Vector3i {
    const Eigen::Array3d voxel = ((middle - grid.origin_m).array() + shift_m) / grid.resolution_m;
    return voxel.floor().min(last_voxel).max(0.0).cast<int>().matrix();
  };
  const Eigen::Vector3i low = voxel_near(-radius_m);
  const Eigen::Vector3i high = voxel_near(radius_m);
  if (low == high) return true;  // the voxel of both ends, which are known
  if ((high - low + Eigen::Vector3i::Ones()).prod() > kMaxVoxels) return false;
  w.points.clear();
  w.targets.clear();
  for (int k = low.z(); k <= high.z(); ++k) {
    for (int j = low.y(); j <= high.y(); ++j) {
      for (int i = low.x(); i <= high.x(); ++i) {
        const Eigen::Vector3d centre = grid.centre_m({i, j, k});
        const Eigen::Array3d away =
            ((middle - centre).array().abs() - 0.5 * grid.resolution_m).max(0.0);
        if (away.matrix().squaredNorm() > radius_m * radius_m) continue;
        if (!must_be_known(item, centre, w)) continue;
        if (dense_ != nullptr) {
          if (!dense_->known({i, j, k})) return false;
          continue;
        }
        const std::size_t voxel = grid.linear({i, j, k});
        if (w.known_voxels[voxel % kRemembered] == voxel + 1) continue;
        w.points.push_back(centre);
        w.targets.push_back(voxel);
      }
    }
  }
  w.distances.resize(w.points.size());
  w.statuses.resize(w.points.size());
  field_->query(w.points, w.distances, {}, w.statuses);
  return std::ranges::find(w.statuses, FieldStatus::kUnknown) == w.statuses.end();
}

ClearanceProver::End ClearanceProver::prove(const Request& request, Listener& listener,
                                            const Deadline& deadline, Workspace& w) const {
  if (deadline.expired()) return End::kDeadline;
  w.keeps_to_observed = request.keeps_to_observed;
  const int pieces = piece_count(request, w);
  if (!measure_ends(request, pieces, listener, w)) return End::kStopped;
  if (pieces == 0 && request.to > request.from) {
    for (int item = 0; item < item_count(); ++item) {
      if (!listener.on_unproven(request.from, item, kInfinity)) return End::kStopped;
    }
  }
  for (int p = 0; p < pieces; ++p) {
    if (!open_piece(request, p, listener, w)) return End::kStopped;
    while (true) {
      if (!sift(request, listener, w)) return End::kStopped;
      if (w.intervals.empty()) break;
      if (deadline.expired()) return End::kDeadline;
      if (!halve(request, listener, w)) return End::kStopped;
    }
  }
  return End::kFinished;
}

bool ClearanceProver::measure_ends(const Request& request, int pieces, Listener& listener,
                                   Workspace& w) const {
  const std::size_t items = idx(item_count());
  const bool goes_on = request.goes_on && w.read_to == request.from;
  w.piece_ends.erase(w.piece_ends.begin(), w.piece_ends.end() - (goes_on ? items : 0));
  w.piece_times.clear();
  for (int p = 0; p <= pieces; ++p) {
    const double share = pieces == 0 ? 0.0 : static_cast<double>(p) / pieces;
    w.piece_times.push_back(
        p == pieces && p > 0 ? request.to : request.from + share * (request.to - request.from));
  }
  w.times.assign(w.piece_times.begin() + (goes_on ? 1 : 0), w.piece_times.end());
  w.read_to.reset();
  if (!measure_all(request.motion, listener, w)) return false;
  for (const Measurement& m : w.measurements) w.piece_ends.push_back(m.reading);
  w.read_to = w.piece_times.back();
  return true;
}

int ClearanceProver::piece_count(const Request& request, Workspace& w) const {
  const std::size_t dof = robot_->description().joints.size();
  w.variation.resize(dof);
  if (!(request.to > request.from)) return 0;
  request.motion.variation(request.from, request.to, w.variation);
  w.levers.clear();
  for (int s = 0; s < sphere_count_; ++s) {
    const auto row = bounds_->sphere_levers(s);
    w.levers.insert(w.levers.end(), row.begin(), row.end());
  }
  const double pieces = std::ceil(longest_way_m(w) / kPiece_m);
  return pieces <= kMaxPieces ? std::max(1, static_cast<int>(pieces)) : 0;
}

bool ClearanceProver::measure_all(const Motion& motion, Listener& listener, Workspace& w) const {
  const std::size_t dof = w.variation.size();
  w.q.resize(w.times.size() * dof);
  w.measurements.clear();
  for (std::size_t k = 0; k < w.times.size(); ++k) {
    motion.configuration(w.times[k], std::span(w.q).subspan(k * dof, dof));
    for (int item = 0; item < item_count(); ++item) {
      w.measurements.push_back({static_cast<int>(k), item, {}});
    }
  }
  return measure_and_tell(listener, w);
}

bool ClearanceProver::measure_and_tell(Listener& listener, Workspace& w) const {
  measure(w);
  return std::ranges::all_of(w.measurements, [&](const Measurement& m) {
    return listener.on_reading(w.times[idx(m.row)], m.item, m.reading);
  });
}

/// Levers for one piece, and its first intervals.
bool ClearanceProver::open_piece(const Request& request, int piece, Listener& listener,
                                 Workspace& w) const {
  const std::size_t dof = w.variation.size();
  const double from = w.piece_times[idx(piece)];
  const double to = w.piece_times[idx(piece) + 1];
  w.q.resize(dof);
  w.centres.resize(idx(sphere_count_));
  w.jacobians.resize(idx(sphere_count_) * dof);
  request.motion.configuration(from, w.q);
  robot_->sphere_jacobians(w.q, w.centres, w.jacobians, w.scratch);
  request.motion.variation(from, to, w.variation);
  bounds_->local_levers(w.jacobians, w.variation, w.levers);

  const double steps = std::max(1.0, std::ceil(longest_way_m(w) / request.max_step_m));
  w.times.clear();
  for (std::int64_t k = 1; static_cast<double>(k) < steps; ++k) {
    w.times.push_back(from + static_cast<double>(k) / steps * (to - from));
  }
  if (!measure_all(request.motion, listener, w)) return false;

  const std::size_t items = idx(item_count());
  const std::size_t inner = w.times.size();
  const auto reading = [&](std::size_t step, std::size_t item) -> const ClearanceReading& {
    if (step > 0 && step <= inner) return w.measurements[(step - 1) * items + item].reading;
    return w.piece_ends[(idx(piece) + (step == 0 ? 0 : 1)) * items + item];
  };
  w.intervals.clear();
  w.gaps.clear();
  for (std::size_t k = 0; k <= inner; ++k) {
    const std::size_t first = w.gaps.size();
    const double begin = k == 0 ? from : w.times[k - 1];
    const double end = k == inner ? to : w.times[k];
    if (inner > 0) request.motion.variation(begin, end, w.variation);
    for (std::size_t item = 0; item < items; ++item) {
      // Most are settled at once, and their readings need not be kept.
      const auto number = static_cast<int>(item);
      if (is_settled(number, reading(k, item), reading(k + 1, item), w)) continue;
      w.gaps.push_back({number, reading(k, item), reading(k + 1, item)});
    }
    if (w.gaps.size() > first) w.intervals.push_back({begin, end, first, w.gaps.size()});
  }
  return true;
}

/// Whether there is nothing to show between two readings: an end is in collision, and has been
/// told of, or they are far enough off for the way in between, at the variation in the workspace.
bool ClearanceProver::is_settled(int item, const ClearanceReading& a, const ClearanceReading& b,
                                 Workspace& w) const {
  if (violates(item, a) || violates(item, b)) return true;
  return shortfall(item, a, b, way_m(item, w), w).amount_m <= 0.0;
}

/// Leaves only the gaps that must be halved.
bool ClearanceProver::sift(const Request& request, Listener& listener, Workspace& w) const {
  w.next_intervals.clear();
  std::size_t kept = 0;
  const bool is_absurd = w.gaps.size() > kMaxGaps;
  for (const Interval& interval : w.intervals) {
    const double middle = 0.5 * (interval.begin + interval.end);
    const bool is_divisible = middle > interval.begin && middle < interval.end && !is_absurd;
    request.motion.variation(interval.begin, interval.end, w.variation);
    const std::size_t first = kept;
    for (std::size_t g = interval.first_gap; g < interval.last_gap; ++g) {
      const Gap& gap = w.gaps[g];
      if (violates(gap.item, gap.a) || violates(gap.item, gap.b)) continue;
      const double way = way_m(gap.item, w);
      const Shortfall short_of = shortfall(gap.item, gap.a, gap.b, way, w);
      if (short_of.amount_m <= 0.0) continue;
      if (!is_divisible || !(way > request.min_step_m)) {
        if (!listener.on_unproven(middle, gap.item, short_of)) return false;
        continue;
      }
      if (kept != g) w.gaps[kept] = gap;
      ++kept;
    }
    if (kept > first) w.next_intervals.push_back({interval.begin, interval.end, first, kept});
  }
  w.gaps.resize(kept);
  w.intervals.swap(w.next_intervals);
  return true;
}

bool ClearanceProver::halve(const Request& request, Listener& listener, Workspace& w) const {
  const std::size_t dof = w.variation.size();
  w.times.clear();
  w.measurements.clear();
  w.q.resize(w.intervals.size() * dof);
  for (std::size_t i = 0; i < w.intervals.size(); ++i) {
    const Interval& interval = w.intervals[i];
    w.times.push_back(0.5 * (interval.begin + interval.end));
    request.motion.configuration(w.times[i], std::span(w.q).subspan(i * dof, dof));
    for (std::size_t g = interval.first_gap; g < interval.last_gap; ++g) {
      w.measurements.push_back({static_cast<int>(i), w.gaps[g].item, {}});
    }
  }
  if (!measure_and_tell(listener, w)) return false;
  w.next_intervals.clear();
  w.next_gaps.clear();
  for (std::size_t i = 0; i < w.intervals.size(); ++i) {
    const Interval& interval = w.intervals[i];
    for (const bool is_left : {true, false}) {
      const std::size_t first = w.next_gaps.size();
      for (std::size_t g = interval.first_gap; g < interval.last_gap; ++g) {
        const Gap& gap = w.gaps[g];
        const ClearanceReading& middle = w.measurements[g].reading;
        w.next_gaps.push_back(is_left ? Gap{gap.item, gap.a, middle}
                                      : Gap{gap.item, middle, gap.b});
      }
      w.next_intervals.push_back({is_left ? interval.begin : w.times[i],
                                  is_left ? w.times[i] : interval.end, first, w.next_gaps.size()});
    }
  }
  w.intervals.swap(w.next_intervals);
  w.gaps.swap(w.next_gaps);
  return true;
}

}  // namespace sidestep
