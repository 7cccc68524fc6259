#include "certify.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <map>
#include <memory>
#include <span>
#include <utility>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>

#include "certificate.hpp"
#include "convex.hpp"
#include "shape_collider.hpp"

namespace sidestep {
namespace {

using Json = nlohmann::ordered_json;
using Coefficients = std::array<double, PolynomialPiece::kTerms>;

/// For the rounding of coordinates: what is proven is more than this better than what is claimed,
/// twice what whoever looks again has to allow.
constexpr double kRounding_m = 2e-9;
/// So that rounding stays below that; of joints, in their units.
constexpr double kMost = 1e3;
/// Directions are written with so many decimals.
constexpr double kDirection = 1e4;
/// Shapes that may be nearer than this are looked at more closely: they may touch.
constexpr double kNear_m = 0.005;
/// Where the hull of a mesh is met, parts in which less than this moves are not looked into.
constexpr double kSmallest_m = 1e-5;
/// A part is no shorter than 2^-kDeepest of the motion.
constexpr int kDeepest = 40;
/// Of joints, in their units.
constexpr double kLimit = 1e-6;

double value(const Coefficients& c, double s) {
  double sum = 0.0;
  for (std::size_t k = c.size(); k-- > 0;) sum = sum * s + c[k];
  return sum;
}

/// The coefficients about s, and those of the derivative.
Coefficients about(Coefficients c, double s) {
  for (std::size_t first = 0; first + 1 < c.size(); ++first) {
    for (std::size_t k = c.size() - 1; k-- > first;) c[k] += s * c[k + 1];
  }
  return c;
}
Coefficients derivative(const Coefficients& c) {
  Coefficients d{};
  for (std::size_t k = 1; k < c.size(); ++k) d[k - 1] = static_cast<double>(k) * c[k];
  return d;
}

/// How far a polynomial goes from where it is at s, at most, within `half` to either side.
double way(const Coefficients& c, double s, double half) {
  const Coefficients near = about(c, s);
  double sum = 0.0, power = 1.0;
  for (std::size_t k = 1; k < near.size(); ++k) sum += std::abs(near[k]) * (power *= half);
  return sum;
}

/// A time in [from, to] at which a polynomial is beyond a limit; NaN: it never is.
double time_beyond(const Coefficients& c, double from, double to, double limit, int depth = 0) {
  const double middle = 0.5 * (from + to);
  if (value(c, middle) > limit + kLimit) return middle;
  const double most = value(c, middle) + way(c, middle, 0.5 * (to - from));
  if (most <= limit + kLimit || depth == kDeepest) return std::nan("");
  const double before = time_beyond(c, from, middle, limit, depth + 1);
  return std::isnan(before) ? time_beyond(c, middle, to, limit, depth + 1) : before;
}

Coefficients negative(Coefficients c) {
  for (double& one : c) one = -one;
  return c;
}

class Certifier {
 public:
  Certifier(const KinematicTree& robot, const Scene& scene, const PolynomialMotion& motion,
            const CertifySettings& settings)
      : robot_(robot),
        description_(robot.description()),
        scene_(scene),
        motion_(motion),
        settings_(settings) {}

  [[nodiscard]] Result<Certification> run() {
    SIDESTEP_TRY(check_input());
    find_movers();
    if (breaks_limit()) return std::move(found_);
    const auto& shapes = description_.shapes;
    for (std::size_t s = 0; s < shapes.size() && !found_.witness; ++s) {
      if (movers_of(shapes[s].link, -1).empty()) continue;  // what no joint moves
      for (std::size_t o = 0; o < scene_.objects().size() && !found_.witness; ++o) {
        const SceneObject& object = scene_.objects()[o];
        show({description_.links[idx(shapes[s].link)].name,
              object.name,
              s,
              std::nullopt,
              {&object.shape, object.T_world_object(0.0)},
              movers_of(shapes[s].link, -1),
              {}},
             {{"shape", s}, {"object", o}});
      }
    }
    for (const auto& [a, b] : description_.self_collision_pairs) {
      const int common = common_ancestor(a, b);
      for (std::size_t s = 0; s < shapes.size(); ++s) {
        for (std::size_t t = 0; t < shapes.size() && !found_.witness; ++t) {
          if (shapes[s].link != a || shapes[t].link != b) continue;
          show({description_.links[idx(a)].name,
                description_.links[idx(b)].name,
                s,
                t,
                {&shapes[t].shape, Transform::Identity()},
                movers_of(a, common),
                movers_of(b, common)},
               {{"shape", s}, {"other", t}});
        }
      }
    }
    conclude();
    return std::move(found_);
  }

 private:
  /// Two shapes, and the links between each and the last one that carries both (none: the world)
  /// that joints move, the farthest out first.
  struct Pair {
    std::string name_a, name_b;
    std::size_t a;
    std::optional<std::size_t> b;  ///< Of the robot; else `fixed` is it.
    PlacedShape fixed;
    std::vector<int> movers_a, movers_b;
  };
  /// A part of the motion: from index / 2^level of it on.
  struct Part {
    int level = 0;
    std::int64_t index = 0;
    friend auto operator<=>(const Part&, const Part&) = default;
  };
  /// The robot in the middle of a part, and how far each joint goes from there.
  struct Instant {
    double time_s = 0.0;
    std::vector<Transform> links;
    std::vector<double> ways;
  };

  [[nodiscard]] Result<void> check_input() const {
    if (description_.shapes.empty()) {
      return fail(ErrorCode::kInvalidArgument,
                  "robot '" + description_.name + "' has no collision shapes: nothing to prove");
    }
    if (motion_.pieces.empty()) return fail(ErrorCode::kInvalidArgument, "the motion is empty");
    for (const SceneObject& object : scene_.objects()) {
      if (object.moves() || object.person >= 0 || object.random) {
        return fail(ErrorCode::kInvalidArgument,
                    "object '" + object.name + "' moves, and a scene that stands still is wanted");
      }
    }
    const auto is_empty = [](const Shape& shape) {
      const auto* const mesh = std::get_if<std::shared_ptr<const Mesh>>(&shape);
      return mesh != nullptr && (*mesh)->triangles.empty();
    };
    for (const SceneObject& object : scene_.objects()) {
      if (!is_empty(object.shape)) continue;
      return fail(ErrorCode::kInvalidArgument, "the mesh of " + object.name + " has no triangles");
    }
    for (const CollisionShape& shape : description_.shapes) {
      if (is_empty(shape.shape)) {
        return fail(
            ErrorCode::kInvalidArgument,
            "a mesh of link " + description_.links[idx(shape.link)].name + " has no triangles");
      }
      if (!std::holds_alternative<HalfSpace>(shape.shape)) continue;
      return fail(ErrorCode::kInvalidArgument, "a link cannot be a half-space");
    }
    double before_s = 0.0;
    for (const PolynomialPiece& piece : motion_.pieces) {
      if (piece.begin_s != before_s || !(piece.end_s > piece.begin_s) ||
          piece.coefficients.size() != description_.joints.size()) {
        return fail(ErrorCode::kInvalidArgument, "the pieces of the motion do not fit together");
      }
      for (std::size_t j = 0; j < piece.coefficients.size(); ++j) {
        const Coefficients& c = piece.coefficients[j];
        const double half_s = 0.5 * (piece.end_s - piece.begin_s);
        if (std::abs(value(c, half_s)) + way(c, half_s, half_s) < kMost) continue;
        return fail(ErrorCode::kInvalidArgument,
                    description_.joints[j].name + " does not stay within 1000 m or rad");
      }
      before_s = piece.end_s;
    }
    return {};
  }

  void find_movers() {
    const auto& joints = robot_.tree_joints();
    for (std::size_t k = 0; k < joints.size(); ++k) {
      moves_.push_back(joints[k].motion != TreeJoint::Motion::kFixed && joints[k].joint >= 0);
    }
  }
  [[nodiscard]] std::vector<int> movers_of(int link, int end) const {
    std::vector<int> movers;
    for (; link != end && link >= 0; link = description_.links[idx(link)].parent) {
      if (moves_[idx(link)]) movers.push_back(link);
    }
    return movers;
  }
  [[nodiscard]] int common_ancestor(int a, int b) const {
    while (a != b) {  // parents come before their children
      int& later = a > b ? a : b;
      later = description_.links[idx(later)].parent;
    }
    return a;
  }

  bool breaks_limit() {
    for (const PolynomialPiece& piece : motion_.pieces) {
      for (std::size_t j = 0; j < piece.coefficients.size(); ++j) {
        const Joint& joint = description_.joints[j];
        const double end_s = piece.end_s - piece.begin_s;
        const Coefficients& q = piece.coefficients[j];
        const auto breaks = [&](const Coefficients& of, double limit, const char* what) {
          const double time_s = time_beyond(of, 0.0, end_s, limit);
          if (std::isnan(time_s)) return false;
          found_.broken_limit = joint.name + " breaks its " + what + " at " +
                                format("%.4f s", piece.begin_s + time_s);
          found_.outcome = Certification::Outcome::kRefuted;
          return true;
        };
        const bool is_bounded = joint.type != Joint::Type::kContinuous;
        if (is_bounded && (breaks(q, joint.upper, "upper limit") ||
                           breaks(negative(q), -joint.lower, "lower limit"))) {
          return true;
        }
        if (!motion_.has_times || !std::isfinite(joint.max_velocity)) continue;
        const Coefficients v = derivative(q);
        if (breaks(v, joint.max_velocity, "velocity limit") ||
            breaks(negative(v), joint.max_velocity, "velocity limit")) {
          return true;
        }
      }
    }
    return false;
  }

  [[nodiscard]] std::pair<double, double> span_s(const Part& part) const {
    const double length_s = std::ldexp(motion_.duration_s(), -part.level);
    const auto index = static_cast<double>(part.index);
    return {length_s * index, length_s * (index + 1.0)};
  }

  const Instant& instant(const Part& part) {
    const auto [known, is_new] = instants_.try_emplace(part);
    Instant& instant = known->second;
    if (!is_new) return instant;
    const auto [from_s, to_s] = span_s(part);
    instant.time_s = 0.5 * (from_s + to_s);
    const auto after = [](double time_s, const PolynomialPiece& piece) {
      return time_s < piece.end_s;
    };
    const auto& pieces = motion_.pieces;
    const auto at =
        std::min(std::ranges::upper_bound(pieces, instant.time_s, {}, &PolynomialPiece::end_s),
                 pieces.end() - 1);
    std::vector<double> q(description_.joints.size());
    for (std::size_t j = 0; j < q.size(); ++j) {
      q[j] = value(at->coefficients[j], instant.time_s - at->begin_s);
    }
    instant.links.resize(description_.links.size());
    robot_.link_poses(q, instant.links, scratch_);
    instant.ways.assign(q.size(), 0.0);
    auto piece = std::upper_bound(pieces.begin(), pieces.end(), from_s, after);
    for (; piece != pieces.end() && piece->begin_s <= to_s; ++piece) {
      const double a = std::max(from_s, piece->begin_s) - piece->begin_s;
      const double b = std::min(to_s, piece->end_s) - piece->begin_s;
      for (std::size_t j = 0; j < q.size(); ++j) {
        const Coefficients& c = piece->coefficients[j];
        // A little longer, for the rounding of times.
        const double half = 0.5 * (b - a) * (1.0 + 1e-12) + 1e-15 * to_s;
        const double middle = 0.5 * (a + b);
        const double off = std::abs(value(c, middle) - q[j]) + way(c, middle, half);
        instant.ways[j] = std::max(instant.ways[j], off);
      }
    }
    return instant;
  }

  /// How far any point of a ball fixed to the first of `movers` may come within a part.
  [[nodiscard]] double way_m(const Instant& instant, const std::vector<int>& movers,
                             const Eigen::Vector3d& centre_m, double radius_m) const {
    double sum_m = 0.0;
    for (const int link : movers) {
      const TreeJoint& joint = robot_.tree_joints()[idx(link)];
      const double turn = std::abs(joint.multiplier) * instant.ways[idx(joint.joint)];
      const bool is_turn = joint.motion == TreeJoint::Motion::kRotation;
      const double arm_m =
          (centre_m - instant.links[idx(link)].translation()).norm() + radius_m + sum_m;
      sum_m += is_turn ? turn * arm_m : turn;
    }
    return sum_m;
  }

  struct Look {
    PlacedShape a, b;
    double way_m;
  };
  [[nodiscard]] Look look(const Pair& pair, const Instant& instant) const {
    const auto place = [&](std::size_t shape) {
      const CollisionShape& of = description_.shapes[shape];
      return PlacedShape{&of.shape, instant.links[idx(of.link)] * of.T_link_shape};
    };
    const auto way = [&](const PlacedShape& of, const std::vector<int>& movers) {
      if (movers.empty()) return 0.0;
      return way_m(instant, movers, of.T_world_shape.translation(), reach_m(*of.shape));
    };
    Look look{place(pair.a), pair.b ? place(*pair.b) : pair.fixed, 0.0};
    look.way_m = way(look.a, pair.movers_a) + way(look.b, pair.movers_b);
    return look;
  }

  static Eigen::Vector3d written(const Eigen::Vector3d& direction) {
    return (direction.normalized() * kDirection).array().round().matrix();
  }

  static bool has_hull(const Look& look) {
    return std::holds_alternative<std::shared_ptr<const Mesh>>(*look.a.shape) ||
           std::holds_alternative<std::shared_ptr<const Mesh>>(*look.b.shape);
  }
  /// Whether FCL finds the two nearer than the margin, triangle by triangle.
  [[nodiscard]] bool touches(const Pair& pair, const Instant& at) {
    if (!collider_) {
      ShapeObstacles obstacles;
      obstacles.scene = std::make_shared<const Scene>(scene_);
      collider_ =
          std::make_unique<ShapeCollider>(description_, obstacles, std::vector<AllowedContact>{});
      pose_ = collider_->make_pose();
    }
    collider_->place(*pose_, at.links, 0.0);
    const double bound_m = settings_.margin_m + kNear_m;
    if (!pair.b) {
      return collider_->to_obstacles(static_cast<int>(pair.a), *pose_, bound_m).clearance_m <
             settings_.margin_m;
    }
    const std::pair links(description_.shapes[pair.a].link, description_.shapes[*pair.b].link);
    for (int p = 0; p < collider_->pair_count(); ++p) {
      if (collider_->pair_links(p) != links) continue;
      if (collider_->between_pair(p, *pose_, bound_m) < settings_.margin_m) return true;
    }
    return false;
  }

  /// Shows a pair apart over the whole motion, or finds where it is not.
  void show(const Pair& pair, Json claim) {
    ++found_.pairs;
    std::vector<std::array<std::int64_t, 5>> parts;
    struct Open {
      Part part;
      Eigen::Vector3d direction;
    };
    // The longest first: so a contact that lasts is found soon.
    std::deque<Open> open{{{}, Eigen::Vector3d::Zero()}};
    int looked = 0;
    bool is_shown = true;
    while (!open.empty()) {
      const Part part = open.front().part;
      const Eigen::Vector3d before = open.front().direction;
      open.pop_front();
      const Instant& at = instant(part);
      const Look look = this->look(pair, at);
      const double wanted_m = settings_.margin_m + look.way_m + kRounding_m;
      const auto is_apart = [&](const Eigen::Vector3d& direction) {
        if (direction.isZero() || !(gap_m(look.a, look.b, direction) > wanted_m)) return false;
        const auto whole = [](double x) { return static_cast<std::int64_t>(x); };
        parts.push_back({part.level, part.index, whole(direction.x()), whole(direction.y()),
                         whole(direction.z())});
        return true;
      };
      const Eigen::Vector3d between =
          look.b.T_world_shape.translation() - look.a.T_world_shape.translation();
      if (is_apart(before) || is_apart(written(between))) continue;
      const NearestPoints nearest =
          nearest_points(look.a, look.b, kNear_m + settings_.margin_m, wanted_m);
      const double distance_m = nearest.overlap ? 0.0 : (nearest.p_b - nearest.p_a).norm();
      const bool is_near = distance_m < std::max(settings_.margin_m, kRounding_m);
      if (is_near && (!has_hull(look) || touches(pair, at))) {
        found_.witness =
            Witness{at.time_s, pair.name_a, pair.name_b, nearest.p_a, nearest.p_b, distance_m};
        return;
      }
      const Eigen::Vector3d direction =
          nearest.overlap ? before : written(nearest.p_b - nearest.p_a);
      if (is_apart(direction)) continue;
      const bool is_end =
          part.level == kDeepest || (is_near && has_hull(look) && look.way_m < kSmallest_m);
      if (is_end || ++looked > settings_.most_parts) {
        const auto [from_s, to_s] = span_s(part);
        found_.undecided.push_back({pair.name_a, pair.name_b, from_s, to_s});
        is_shown = false;
        break;
      }
      open.push_back({{part.level + 1, 2 * part.index}, direction});
      open.push_back({{part.level + 1, 2 * part.index + 1}, direction});
    }
    if (!is_shown) return;
    std::ranges::sort(parts, {}, [](const auto& part) {
      return part[1] << (kDeepest - static_cast<int>(part[0]));
    });
    found_.parts += parts.size();
    claims_.push_back({std::move(claim), std::move(parts)});
  }

  void conclude() {
    using Outcome = Certification::Outcome;
    found_.outcome = found_.witness             ? Outcome::kRefuted
                     : found_.undecided.empty() ? Outcome::kProven
                                                : Outcome::kUndecided;
    if (found_.outcome != Outcome::kProven) return;
    Json claims = Json::array();
    for (auto& [claim, parts] : claims_) {
      claim["parts"] = parts;
      claims.push_back(std::move(claim));
    }
    found_.certificate = claimed(robot_, scene_, motion_, settings_.margin_m);
    found_.certificate["claims"] = std::move(claims);
  }

  const KinematicTree& robot_;
  const RobotDescription& description_;
  const Scene& scene_;
  const PolynomialMotion& motion_;
  const CertifySettings& settings_;
  std::vector<bool> moves_;  ///< Links, against their parents.
  std::map<Part, Instant> instants_;
  Scratch scratch_;
  std::unique_ptr<ShapeCollider> collider_;  ///< Once a hull has been met.
  ShapeCollider::PosePtr pose_;
  /// What is claimed of which shapes, and its parts.
  std::vector<std::pair<Json, std::vector<std::array<std::int64_t, 5>>>> claims_;
  Certification found_;
};

}  // namespace

Result<Certification> certify(const KinematicTree& robot, const Scene& scene,
                              const PolynomialMotion& motion, const CertifySettings& settings) {
  return Certifier(robot, scene, motion, settings).run();
}

}  // namespace sidestep
