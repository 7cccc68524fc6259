#include <sidestep/certificates/certify.hpp>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <utility>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>

#include "certificate.hpp"
#include "parted_motion.hpp"
#include "polynomials.hpp"

namespace sidestep {
namespace {

using polynomials::Coefficients;
using polynomials::derivative;
using polynomials::negative;
using polynomials::time_beyond;
using polynomials::value;
using polynomials::way;

/// For the rounding of coordinates: what is proven is more than this better than what is claimed,
/// twice what whoever looks again has to allow.
constexpr double kRounding_m = 2e-9;
/// So that rounding stays below that; of joints, in their units.
constexpr double kMost = 1e3;
/// Directions are written in whole numbers of this length: short ones, and, where their rounding
/// would lose a gap, long ones.
constexpr double kDirection = 1e4;
constexpr double kLongDirection = 1e9;
/// Shapes that may be nearer than this are looked at more closely: they may touch.
constexpr double kNear_m = 0.005;

class Certifier {
 public:
  Certifier(const KinematicTree& robot, const CertifiedScene& scene, const PolynomialMotion& motion,
            const CertifySettings& settings)
      : robot_(robot),
        description_(robot.description()),
        scene_(scene),
        motion_(motion),
        settings_(settings) {}

  [[nodiscard]] Result<Certification> run() {
    SIDESTEP_TRY(check_input());
    if (breaks_limit()) return std::move(found_);
    for (const CollisionShape& shape : description_.shapes) {
      shapes_.emplace_back(shape.shape);
    }
    for (const SceneObject& object : scene_.scene.objects()) {
      objects_.push_back({object.name, Body(object.shape), object.T_world_object(0.0), {}});
    }
    for (const Swarm& swarm : scene_.swarms) {
      objects_.push_back({swarm.name, Body(swarm), Transform::Identity(), {}});
    }
    for (const AllowedContact& allowed : scene_.allowed) {
      const auto link = description_.link_index(allowed.link);
      for (CertifiedObject& object : objects_) {
        if (link && object.name == allowed.object) object.may_touch.push_back(*link);
      }
    }
    SIDESTEP_TRY(check_extent());
    parts_.emplace(robot_, motion_, shapes_);
    show_all();
    conclude();
    return std::move(found_);
  }

 private:
  using Instant = PartedMotion::Instant;
  using Carried = PartedMotion::Carried;

  /// Two bodies, and how many of what carries each do not carry both.
  struct Pair {
    std::size_t a = 0;             ///< A shape.
    std::optional<std::size_t> b;  ///< Another one; else `object` is it.
    const CertifiedObject* object = nullptr;
    std::size_t carriers_a = 0, carriers_b = 0;
  };
  [[nodiscard]] Result<void> check_input() const {
    if (description_.shapes.empty()) {
      return fail(ErrorCode::kInvalidArgument,
                  "robot '" + description_.name + "' has no collision shapes: nothing to prove");
    }
    if (motion_.pieces.empty()) return fail(ErrorCode::kInvalidArgument, "the motion is empty");
    const auto moves = [](const SceneObject& object) {
      return object.moves() || object.person >= 0 || object.random;
    };
    const auto& objects = scene_.scene.objects();
    const People& people = scene_.scene.people();
    const auto one = std::ranges::find_if(objects, moves);
    if (one != objects.end() || !people.groups.empty() || !people.persons.empty()) {
      return fail(ErrorCode::kInvalidArgument,
                  "it moves, or is drawn, and a scene that stands still is wanted",
                  one != objects.end() ? one->name : "people");
    }
    const auto is_empty = [](const Shape& shape) {
      const auto* const mesh = std::get_if<std::shared_ptr<const Mesh>>(&shape);
      return mesh != nullptr && (*mesh)->triangles.empty();
    };
    for (const SceneObject& object : scene_.scene.objects()) {
      if (!is_empty(object.shape)) continue;
      return fail(ErrorCode::kInvalidArgument, "the mesh of " + object.name + " has no triangles");
    }
    for (const Swarm& swarm : scene_.swarms) {
      if (!swarm.members.empty()) continue;
      return fail(ErrorCode::kInvalidArgument, swarm.name + " is empty");
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
      if (piece.begin_s != before_s || !(piece.end_s > piece.begin_s + 1e-9) ||
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

  /// Bodies are near enough for coordinates to be as exact as is claimed. Names those that have no
  /// inside.
  [[nodiscard]] Result<void> check_extent() {
    const auto check = [&](const std::string& name, const Body& body,
                           const Transform& T) -> Result<void> {
      if (!body.triangles().empty() && !body.is_closed_mesh()) found_.surfaces.push_back(name);
      const bool is_far = T.translation().cwiseAbs().maxCoeff() > 0.5 * kMost ||
                          body.centre(body.all()).norm() > 0.5 * kMost ||
                          body.extent_m(body.all()) > 0.5 * kMost ||
                          (body.reach_m() > 0.5 * kMost && !body.is_half_space());
      if (!is_far) return {};
      return fail(ErrorCode::kInvalidArgument, "reaches beyond 500 m", name);
    };
    for (std::size_t s = 0; s < shapes_.size(); ++s) {
      SIDESTEP_TRY(check(link_name(s), shapes_[s], description_.shapes[s].T_link_shape));
    }
    for (const CertifiedObject& object : objects_) {
      SIDESTEP_TRY(check(object.name, object.body, object.T_world_body));
    }
    return {};
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
        const auto breaks = [&](const Coefficients& of, double sign, double limit,
                                const char* what) {
          const double time_s =
              time_beyond(sign < 0.0 ? negative(of) : of, 0.0, end_s, sign * limit);
          if (std::isnan(time_s)) return false;
          found_.broken_limit = joint.name + " breaks its " + what +
                                format(" of %g at %.4f s: it is %g", limit, piece.begin_s + time_s,
                                       value(of, time_s));
          found_.outcome = Certification::Outcome::kRefuted;
          return true;
        };
        const bool is_bounded = joint.type != Joint::Type::kContinuous;
        if (is_bounded && (breaks(q, 1.0, joint.upper, "upper limit") ||
                           breaks(q, -1.0, joint.lower, "lower limit"))) {
          return true;
        }
        if (!motion_.has_times || !std::isfinite(joint.max_velocity)) continue;
        const Coefficients v = derivative(q);
        if (breaks(v, 1.0, joint.max_velocity, "velocity limit") ||
            breaks(v, -1.0, -joint.max_velocity, "velocity limit")) {
          return true;
        }
      }
    }
    return false;
  }

  void show_all() {
    for (std::size_t s = 0; s < shapes_.size(); ++s) {
      const std::size_t carriers = parts_->carriers_beyond(-1, s);
      if (carriers == 0) continue;  // what no joint moves
      for (std::size_t o = 0; o < objects_.size() && !found_.witness; ++o) {
        if (std::ranges::count(objects_[o].may_touch, description_.shapes[s].link) > 0) continue;
        show({.a = s, .object = &objects_[o], .carriers_a = carriers});
      }
    }
    for (const auto& [a, b] : description_.self_collision_pairs) {
      const int common = common_ancestor(a, b);
      for (std::size_t s = 0; s < shapes_.size(); ++s) {
        for (std::size_t t = 0; t < shapes_.size() && !found_.witness; ++t) {
          if (description_.shapes[s].link != a || description_.shapes[t].link != b) continue;
          show({.a = s,
                .b = t,
                .carriers_a = parts_->carriers_beyond(common, s),
                .carriers_b = parts_->carriers_beyond(common, t)});
        }
      }
    }
  }

  [[nodiscard]] const std::string& link_name(std::size_t shape) const {
    return description_.links[idx(description_.shapes[shape].link)].name;
  }
  [[nodiscard]] const std::string& name_a(const Pair& pair) const { return link_name(pair.a); }
  [[nodiscard]] const std::string& name_b(const Pair& pair) const {
    return pair.b ? link_name(*pair.b) : pair.object->name;
  }
  [[nodiscard]] PlacedBody place(std::size_t shape, const Instant& at) const {
    const CollisionShape& of = description_.shapes[shape];
    return {&shapes_[shape], shapes_[shape].all(), at.links[idx(of.link)] * of.T_link_shape};
  }
  [[nodiscard]] std::pair<PlacedBody, PlacedBody> place(const Pair& pair, const Instant& at) const {
    const CertifiedObject* const object = pair.object;
    return {place(pair.a, at),
            pair.b ? place(*pair.b, at)
                   : PlacedBody{&object->body, object->body.all(), object->T_world_body}};
  }

  static Eigen::Vector3i written(const Eigen::Vector3d& direction, double length = kDirection) {
    return (direction.normalized() * length).array().round().matrix().cast<int>();
  }

  /// Where the two are nearer than the margin, or in each other.
  [[nodiscard]] std::optional<NearestPoints> contact(const PlacedBody& a,
                                                     const PlacedBody& b) const {
    const double near_m = std::max(settings_.margin_m, kRounding_m);
    const NearestPoints nearest = nearest_points(a, b, std::numeric_limits<double>::infinity(),
                                                 near_m, b.centre() - a.centre());
    if (!(nearest.distance_m() < near_m)) return {};
    if (a.share.is_single() && b.share.is_single()) return nearest;
    const bool is_of_a = a.body->extent_m(a.share) > b.body->extent_m(b.share);
    for (const Share& half : (is_of_a ? a : b).share.halves()) {
      PlacedBody of_a = a, of_b = b;
      (is_of_a ? of_a : of_b).share = half;
      if (auto found = contact(of_a, of_b)) return found;
    }
    return {};
  }

  /// A point of `other` that is inside a mesh; those of its triangles are looked at elsewhere.
  [[nodiscard]] static std::optional<Eigen::Vector3d> inside(const PlacedBody& mesh,
                                                             const PlacedBody& other) {
    if (!mesh.body->is_closed_mesh() || other.body->is_half_space()) return {};
    const Transform T_mesh_other = mesh.T_world_body.inverse() * other.T_world_body;
    for (const Eigen::Vector3d& p : other.body->points()) {
      const Eigen::Vector3d p_mesh = T_mesh_other * p;
      if (!mesh.body->may_hold(p_mesh)) continue;
      if (signed_distance_m(mesh.body->shape(), p_mesh) < 0.0) return other.T_world_body * p;
    }
    return {};
  }

  /// A part of the motion, and shares of two bodies, in the tree of what is to be shown.
  struct Open {
    enum class Kind { kApart, kTime, kShareOfA, kShareOfB };
    Kind kind = Kind::kApart;
    MotionPart part;
    Share a, b;
    Eigen::Vector3i direction = Eigen::Vector3i::Zero();
    bool is_looked_at = false;  ///< No contact in the middle of the part.
    std::size_t halves = 0;     ///< The first of them; the other one follows.
  };

  /// Shows a pair apart over the whole motion, or finds where it is not.
  void show(const Pair& pair) {
    ++found_.pairs;
    if (starts_inside(pair)) return;
    // The longest parts first: so a contact that lasts is found soon.
    std::vector<Open>& tree = tree_;
    tree.assign(1, {});
    std::tie(tree[0].a, tree[0].b) =
        std::pair(shapes_[pair.a].all(), pair.b ? shapes_[*pair.b].all() : pair.object->body.all());
    for (std::size_t i = 0; i < tree.size(); ++i) {
      if (show(pair, tree[i])) continue;
      if (found_.witness) return;
      const Open& open = tree[i];
      const bool is_last = open.kind == Open::Kind::kTime && open.part.level == kDeepest;
      if (is_last || tree.size() > idx(2 * settings_.most_parts)) {
        const auto [from_s, to_s] = parts_->span_s(open.part);
        found_.undecided.push_back({name_a(pair), name_b(pair), from_s, to_s});
        return;
      }
      tree[i].halves = tree.size();
      for (const int half : {0, 1}) {
        Open next = tree[i];
        switch (next.kind) {
          case Open::Kind::kApart: break;
          case Open::Kind::kTime:
            next.part = {next.part.level + 1, 2 * next.part.index + half};
            next.is_looked_at = false;
            break;
          case Open::Kind::kShareOfA: next.a = next.a.halves()[idx(half)]; break;
          case Open::Kind::kShareOfB: next.b = next.b.halves()[idx(half)]; break;
        }
        tree.push_back(next);
      }
    }
    found_.parts += (tree.size() + 1) / 2;
    if (!settings_.wants_certificate) return;
    claims_ += claims_.empty() ? "{\"shape\":" : ",{\"shape\":";
    claims_ += std::to_string(pair.a) + (pair.b ? ",\"other\":" : ",\"object\":");
    claims_ += std::to_string(pair.b ? *pair.b : idx(pair.object - objects_.data()));
    claims_ += ",\"parts\":";
    write(tree, 0);
    claims_ += '}';
  }

  bool starts_inside(const Pair& pair) {
    const Instant& at = parts_->at({kDeepest, 0});
    const auto [a, b] = place(pair, at);
    auto p = inside(a, b);
    if (!p) p = inside(b, a);
    if (p) found_.witness = Witness{at.time_s, name_a(pair), name_b(pair), *p, *p, 0.0};
    return p.has_value();
  }

  /// Shows two shares apart in a part; else says by what they are to be halved, or has found a
  /// contact.
  bool show(const Pair& pair, Open& open) {
    Instant& at = parts_->at(open.part);
    auto placed = place(pair, at);
    auto& a = placed.first;
    auto& b = placed.second;
    a.share = open.a;
    b.share = open.b;
    const std::array carried{
        parts_->carried(at, pair.a, pair.carriers_a),
        pair.b ? parts_->carried(at, *pair.b, pair.carriers_b) : std::span<const Carried>()};
    double way_m = 0.0;
    for (const auto& by : carried) way_m += by.empty() ? 0.0 : by.back().way_m;
    const auto wanted = [&](const Eigen::Vector3d& direction) {
      const Eigen::Vector3d n =
          b.body->is_half_space() ? b.T_world_body.linear().col(2) : direction.normalized();
      double along_m = 0.0;
      for (const auto& bys : carried) {
        for (const Carried& by : bys) along_m += std::abs(n.dot(by.turn_m));
        if (!bys.empty()) along_m += bys.back().more_m;
      }
      return settings_.margin_m + std::min(way_m, along_m) + kRounding_m;
    };
    if (open.direction.isZero()) open.direction = written(b.centre() - a.centre());
    const Eigen::Vector3d along = open.direction.cast<double>();
    const double wanted_m = wanted(along);
    const NearestPoints nearest =
        nearest_points(a, b, kNear_m + settings_.margin_m, wanted_m, along);
    if (nearest.apart_m > wanted_m && nearest.direction == along) {
      open.kind = Open::Kind::kApart;
      return true;
    }
    if (nearest.direction != along && nearest.apart_m > wanted(nearest.direction)) {
      open.kind = Open::Kind::kApart;
      for (const double length : {kDirection, kLongDirection}) {
        open.direction = written(nearest.direction, length);
        const Eigen::Vector3d n = open.direction.cast<double>();
        if (gap_m(a, b, n) > wanted(n)) return true;
      }
    }
    const bool is_near = nearest.distance_m() < std::max(settings_.margin_m, kRounding_m);
    if (is_near && !open.is_looked_at) {
      if (const auto met = contact(a, b)) {
        found_.witness =
            Witness{at.time_s, name_a(pair), name_b(pair), met->p_a, met->p_b, met->distance_m()};
        return false;
      }
      open.is_looked_at = true;
    }
    if (!nearest.direction.isZero()) open.direction = written(nearest.direction);
    const double extent_a_m = a.body->extent_m(a.share), extent_b_m = b.body->extent_m(b.share);
    // What is larger is halved; time, too, where that is likely to be enough.
    const double of_time_m = open.part.level == kDeepest        ? 0.0
                             : nearest.apart_m > 0.5 * wanted_m ? kMost
                                                                : way_m;
    const bool is_of_shares = std::max(extent_a_m, extent_b_m) > of_time_m;
    open.kind = !is_of_shares             ? Open::Kind::kTime
                : extent_a_m > extent_b_m ? Open::Kind::kShareOfA
                                          : Open::Kind::kShareOfB;
    return false;
  }

  /// Of a tree, as JSON.
  void write(const std::vector<Open>& tree, std::size_t i) {
    const Open& open = tree[i];
    if (open.kind == Open::Kind::kApart) {
      std::array<char, 40> apart;  // three whole numbers
      char* end = apart.data();
      for (const int k : {0, 1, 2}) {
        *end++ = k == 0 ? '[' : ',';
        end = std::to_chars(end, apart.end(), open.direction[k]).ptr;
      }
      claims_.append(apart.data(), end);
    } else {
      claims_ += open.kind == Open::Kind::kTime       ? "[\"time\","
                 : open.kind == Open::Kind::kShareOfA ? "[\"first\","
                                                      : "[\"second\",";
      write(tree, open.halves);
      claims_ += ',';
      write(tree, open.halves + 1);
    }
    claims_ += ']';
  }

  void conclude() {
    using Outcome = Certification::Outcome;
    found_.outcome = found_.witness             ? Outcome::kRefuted
                     : found_.undecided.empty() ? Outcome::kProven
                                                : Outcome::kUndecided;
    if (found_.outcome != Outcome::kProven || !settings_.wants_certificate) return;
    found_.certificate =
        certificate_text(robot_, shapes_, objects_, motion_, settings_.margin_m, claims_);
  }

  const KinematicTree& robot_;
  const RobotDescription& description_;
  const CertifiedScene& scene_;
  const PolynomialMotion& motion_;
  const CertifySettings& settings_;
  std::vector<Body> shapes_;
  std::vector<CertifiedObject> objects_;
  std::optional<PartedMotion> parts_;
  std::vector<Open> tree_;  ///< Of the pair that is looked at.
  std::string claims_;
  Certification found_;
};

}  // namespace

std::string_view name_of(Certification::Outcome outcome) noexcept {
  switch (outcome) {
    case Certification::Outcome::kProven: return "proven";
    case Certification::Outcome::kRefuted: return "refuted";
    case Certification::Outcome::kUndecided: break;
  }
  return "undecided";
}

Result<Certification> certify(const KinematicTree& robot, const CertifiedScene& scene,
                              const PolynomialMotion& motion, const CertifySettings& settings) {
  return Certifier(robot, scene, motion, settings).run();
}

}  // namespace sidestep
