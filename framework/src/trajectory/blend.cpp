#include <sidestep/trajectory/blend.hpp>

#include <algorithm>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace sidestep {
namespace {

constexpr double kLeastLine = 1e-9;  ///< Of a line: less of it between two corners is rounding.

using ConstRow = Eigen::Map<const Eigen::VectorXd>;

ConstRow state(const Trajectory& path, int i) { return {path.q(i).data(), path.dof}; }

Result<void> check(const Trajectory& path, double reach) {
  SIDESTEP_TRY(path.validate());
  if (!(reach > 0.0)) {
    return invalid("the reach of a rounded corner must be positive, not " + std::to_string(reach));
  }
  if (path.size() < 2) {
    return invalid("a path of fewer than two states has no lines");
  }
  for (int i = 0; i < path.size(); ++i) {
    const auto qdot = path.qdot(i);
    if (std::ranges::any_of(qdot, [](double v) { return v != 0.0; })) {
      return invalid("state " + std::to_string(i) + " of the path moves: it has no corner");
    }
    if (i > 0 && state(path, i) == state(path, i - 1)) {
      return invalid("states " + std::to_string(i - 1) + " and " + std::to_string(i) +
                     " of the path are one");
    }
  }
  return {};
}

/// A path as it is written, state by state.
class Writer {
 public:
  explicit Writer(int dof) { path_.dof = dof; }

  void add(const Eigen::VectorXd& q, const Eigen::VectorXd& qdot, double after_s) {
    path_.times_s.push_back(path_.times_s.empty() ? 0.0 : path_.times_s.back() + after_s);
    path_.positions.insert(path_.positions.end(), q.begin(), q.end());
    path_.velocities.insert(path_.velocities.end(), qdot.begin(), qdot.end());
  }
  [[nodiscard]] Trajectory&& take() { return std::move(path_); }

 private:
  Trajectory path_;
};

}  // namespace

Result<Trajectory> blend_corners(const Trajectory& path, double reach) {
  SIDESTEP_TRY(check(path, reach));
  const int lines = path.size() - 1;
  std::vector<Eigen::VectorXd> directions;
  std::vector<double> lengths;
  for (int i = 0; i < lines; ++i) {
    const Eigen::VectorXd line = state(path, i + 1) - state(path, i);
    lengths.push_back(line.norm());
    directions.push_back(line / lengths.back());
  }
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(path.dof);
  Writer writer(path.dof);
  writer.add(state(path, 0), rest, 0.0);
  double used = 0.0;  // of the line, by the corner before it
  for (std::size_t i = 0; i + 1 < lengths.size(); ++i) {
    const ConstRow corner = state(path, static_cast<int>(i) + 1);
    const double cut = std::min({reach, 0.5 * lengths[i], 0.5 * lengths[i + 1]});
    const double left = lengths[i] - used - cut;
    // From rest to unit speed a line takes twice its length.
    if (left > kLeastLine * lengths[i]) {
      writer.add(corner - cut * directions[i], directions[i], (i == 0 ? 2 : 1) * left);
    }
    writer.add(corner + cut * directions[i + 1], directions[i + 1], 2.0 * cut);
    used = cut;
  }
  writer.add(state(path, lines), rest, 2.0 * (lengths.back() - used));
  return writer.take();
}

}  // namespace sidestep
