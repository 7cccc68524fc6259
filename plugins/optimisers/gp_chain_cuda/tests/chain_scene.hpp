#pragma once

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "chain_batch.hpp"

/// A batch for a device, made of nothing but numbers: a mobile arm with the costs of the HSR's
/// plans among boxes in a room.
namespace sidestep::gp_chain_cuda::test {

class ChainScene {
 public:
  /// 2 joints of the base, then `turning` that turn about z and y; `size`: of the field in voxels
  /// of 5 cm.
  ChainScene(int turning, int states, int checks, const cuda::Extent& size) {
    ChainProblem& sizes = description_.problem;
    sizes.dof = 2 + turning;
    sizes.states = states;
    sizes.checks = checks;
    sizes.dt_s = 8.0 / (states - 1);
    add_prior();
    add_robot(turning);
    add_field(size);
    add_terms();
  }

  [[nodiscard]] const ChainDescription& description() const { return description_; }
  [[nodiscard]] const FieldOnDevice& shape() const { return shape_; }
  [[nodiscard]] std::vector<FieldBlockOnHost> blocks() const {
    std::vector<FieldBlockOnHost> all;
    for (int b = 0; b < shape_.blocks.x * shape_.blocks.y * shape_.blocks.z; ++b) {
      all.push_back({b, distances_m_.data() + std::ptrdiff_t{b} * PlaceBlocks::kVoxels,
                     known_.data() + std::ptrdiff_t{b} * PlaceBlocks::kRows});
    }
    return all;
  }
  [[nodiscard]] SamplesOnHost samples() const {
    SamplesOnHost none;
    none.steps.resize(static_cast<std::size_t>(description_.problem.states));
    none.deviations.assign(static_cast<std::size_t>(description_.problem.dof), 0.0);
    return none;
  }

  /// A straight line from one side of the room to the other, each number another one.
  void add_start(int number) {
    const int d = description_.problem.dof, states = description_.problem.states;
    std::mt19937 random(static_cast<unsigned>(number) + 1U);
    const auto within = [&](double low, double high) {
      return low + (high - low) * static_cast<double>(random()) / 4294967296.0;
    };
    std::vector<double> from(static_cast<std::size_t>(d)), to(from.size());
    for (std::size_t j = 0; j < from.size(); ++j) {
      const double reach = j < 2 ? 0.3 * side_m() : 0.8;
      from[j] = j == 0 ? -reach : within(-reach, reach);
      to[j] = j == 0 ? reach : within(-reach, reach);
    }
    std::vector<double>& line = lines_.emplace_back();
    for (int i = 0; i < states; ++i) {
      const double share = static_cast<double>(i) / (states - 1);
      for (std::size_t j = 0; j < from.size(); ++j) {
        line.push_back(from[j] + share * (to[j] - from[j]));
      }
      for (std::size_t j = 0; j < from.size(); ++j) line.push_back((to[j] - from[j]) / 8.0);
    }
    // Both ends, where it rests.
    std::vector<double>& numbers = numbers_.emplace_back();
    for (const auto& end : {from, to}) {
      numbers.insert(numbers.end(), end.begin(), end.end());
      numbers.insert(numbers.end(), end.size(), 1e3);
      numbers.insert(numbers.end(), end.size(), 0.0);
      numbers.insert(numbers.end(), end.size(), 1e3);
    }
  }
  /// Of all that were added. Valid until the next one is.
  [[nodiscard]] std::vector<ChainStart> starts() const {
    std::vector<ChainStart> all;
    for (std::size_t i = 0; i < lines_.size(); ++i) all.push_back({lines_[i], numbers_[i], 0});
    return all;
  }

 private:
  static constexpr double kResolution_m = 0.05;

  [[nodiscard]] double side_m() const { return kResolution_m * shape_.size_vox.x; }

  void add_prior() {
    ChainProblem& sizes = description_.problem;
    const double dt = sizes.dt_s;
    sizes.prior = {{12.0 / (dt * dt * dt), -6.0 / (dt * dt), 4.0 / dt},
                   {12.0 / (dt * dt * dt), 6.0 / (dt * dt), 4.0 / dt},
                   {{-12.0 / (dt * dt * dt), -6.0 / (dt * dt)}, {6.0 / (dt * dt), 2.0 / dt}}};
    description_.inverse_qc.assign(static_cast<std::size_t>(sizes.dof), 1.0);
    for (int k = 1; k <= sizes.checks; ++k) {  // cubic Hermite interpolation
      const double u = k / (sizes.checks + 1.0), v = u * u, w = u * u * u;
      description_.interpolations.push_back(
          {{{1.0 - 3.0 * v + 2.0 * w, dt * (u - 2.0 * v + w), 3.0 * v - 2.0 * w, dt * (w - v)},
            {6.0 * (v - u) / dt, 1.0 - 4.0 * u + 3.0 * v, 6.0 * (u - v) / dt, 3.0 * v - 2.0 * u}}});
    }
  }

  void add_robot(int turning) {
    const Mat3 turned[] = {{{0, 0, 1}, {1, 0, 0}, {0, 1, 0}},   // z along the y of before
                           {{0, 1, 0}, {0, 0, 1}, {1, 0, 0}}};  // z along the x of before
    const auto add = [&](int joint, Motion motion, const Pose& at) {
      const int parent = static_cast<int>(description_.bodies.size()) - 1;
      description_.bodies.push_back({parent, motion, joint, 1.0, 0.0, at});
      return parent + 1;
    };
    add(-1, Motion::kFixed, {});
    add(0, Motion::kTranslation, {turned[1], {0, 0, 0.3}});
    add(1, Motion::kTranslation, {turned[1], {}});
    for (int j = 0; j < turning; ++j) {
      const int body = add(2 + j, Motion::kRotation,
                           {j == 0 ? turned[1] : turned[j % 2], {j == 0 ? 0.0 : 0.16, 0, 0}});
      for (int s = 0; s < 4; ++s) {
        description_.spheres.push_back({body, {0.04 * s, 0.0, j == 0 ? 0.1 * s : 0.0}});
      }
      if (j < 3) continue;
      for (int a = 0; a < 4; ++a) {
        for (int b = 0; b < 4; ++b) {
          description_.pairs.push_back({a, 4 * j + b, 0.02 + 0.2 + radius_m(4 * j)});
        }
      }
      description_.pair_ends.push_back(static_cast<std::int32_t>(description_.pairs.size()));
    }
    description_.problem.bodies = static_cast<int>(description_.bodies.size());
    description_.problem.spheres = static_cast<int>(description_.spheres.size());
  }
  static double radius_m(int sphere) { return sphere < 4 ? 0.2 : 0.06; }

  /// Exact distances to some boxes, cut off at 0.8 m; a corner of the room was never seen.
  void add_field(const cuda::Extent& size) {
    shape_.size_vox = size;
    shape_.blocks = {(size.x + 15) / 16, (size.y + 15) / 16, (size.z + 15) / 16};
    shape_.resolution_m = kResolution_m;
    shape_.origin_m = {-0.5 * kResolution_m * size.x, -0.5 * kResolution_m * size.y, 0.0};
    std::mt19937 random(11);
    std::vector<std::pair<Vec3, Vec3>> boxes;
    for (int i = 0; i < 12; ++i) {
      const auto place = [&](double half) {
        return half * (2.0 * static_cast<double>(random()) / 4294967296.0 - 1.0);
      };
      const Vec3 low{place(0.2 * side_m()), place(0.45 * side_m()), 0.0};
      boxes.push_back({low, low + Vec3{0.4, 0.4, 0.3 + 0.08 * i}});
    }
    const int count = shape_.blocks.x * shape_.blocks.y * shape_.blocks.z;
    distances_m_.assign(static_cast<std::size_t>(count) * PlaceBlocks::kVoxels, 0.0F);
    known_.assign(static_cast<std::size_t>(count) * PlaceBlocks::kRows, 0xffff);
    for (int z = 0; z < size.z; ++z) {
      for (int y = 0; y < size.y; ++y) {
        for (int x = 0; x < size.x; ++x) {
          const Vec3 p = shape_.origin_m + kResolution_m * Vec3{x + 0.5, y + 0.5, z + 0.5};
          double nearest_m = 0.8;
          for (const auto& [low, high] : boxes) {
            const Vec3 off{detail::inwards(p.x, low.x, high.x), detail::inwards(p.y, low.y, high.y),
                           detail::inwards(p.z, low.z, high.z)};
            nearest_m = std::min(nearest_m, norm(off));
          }
          const std::size_t voxel = detail::voxel_at(shape_, x, y, z);
          distances_m_[voxel] = static_cast<float>(nearest_m);
          if (x + y < size.x / 8) {
            known_[voxel / 16] =
                static_cast<std::uint16_t>(known_[voxel / 16] & ~(1u << voxel % 16));
          }
        }
      }
    }
  }

  void add_term(Term::Kind kind, At at, double sigma, const std::vector<double>& numbers) {
    ChainProblem& sizes = description_.problem;
    Term& term = sizes.term[sizes.terms++];
    term.kind = kind;
    term.at = at;
    term.weight = 1.0 / sigma;
    term.numbers = static_cast<int>(description_.numbers.size());
    description_.numbers.insert(description_.numbers.end(), numbers.begin(), numbers.end());
  }

  void add_terms() {
    ChainProblem& sizes = description_.problem;
    const auto d = static_cast<std::size_t>(sizes.dof);
    std::vector<double> reach_m, begins_m, limits(2 * d), speeds(2 * d);
    for (int s = 0; s < sizes.spheres; ++s) {
      reach_m.push_back(0.2 + radius_m(s));
      begins_m.push_back(s < 4 ? -cuda::kInfinity : 0.1 + radius_m(s));
    }
    for (std::size_t j = 0; j < d; ++j) {
      limits[d + j] = j < 2 ? side_m() : 1.9;
      speeds[d + j] = 0.8;
      limits[j] = -limits[d + j];
      speeds[j] = -speeds[d + j];
    }
    for (const At at : {At::kStart, At::kGoal}) {
      add_term(Term::Kind::kTarget, at, 1.0, {});
      sizes.term[sizes.terms - 1].numbers = sizes.own_numbers;
      sizes.own_numbers += 4 * sizes.dof;
    }
    add_term(Term::Kind::kObstacle, At::kEverywhere, 0.05, reach_m);
    add_term(Term::Kind::kFloor, At::kEverywhere, 0.05, begins_m);
    add_term(Term::Kind::kPositionLimit, At::kEverywhere, 0.01, limits);
    add_term(Term::Kind::kVelocityLimit, At::kEverywhere, 0.05, speeds);
    add_term(Term::Kind::kSelfCollision, At::kEverywhere, 0.05, {});
    sizes.term[sizes.terms - 1].numbers = 0;
    sizes.term[sizes.terms - 1].count = static_cast<int>(description_.pair_ends.size());
  }

  ChainDescription description_;
  FieldOnDevice shape_;
  std::vector<float> distances_m_;
  std::vector<std::uint16_t> known_;
  std::vector<std::vector<double>> lines_, numbers_;
};

}  // namespace sidestep::gp_chain_cuda::test
