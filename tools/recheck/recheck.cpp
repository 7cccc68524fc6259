// Looks again at a certificate of `sidestep certify` (docs/reference/certificates.md), with plain
// loops, and accepts or refuses it. Shares no code with what wrote it: read this file to know what
// a certificate is worth.
//
// A certificate holds a robot, objects, a motion, and for each two bodies a tree: of halves of
// halves of the motion and of the items that a body is made of (the triangles of a mesh, the cubes
// of a map), with a direction at each end. In the middle of such a part of the motion the two lie
// on two sides of a gap across that direction; from there neither moves farther, in that part, than
// the gap is wide.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <map>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <nlohmann/json.hpp>

namespace {

using Json = nlohmann::json;
using Vec = Eigen::Vector3d;
using Mat = Eigen::Matrix3d;

/// For the rounding of coordinates below 1000 m.
constexpr double kRounding_m = 1e-9, kMost = 1e3;
constexpr double kLimitTolerance = 1e-6;
constexpr int kDeepest = 40;

[[noreturn]] void refuse(const std::string& why) { throw std::runtime_error(why); }

double number(const Json& json) {
  const double x = json.get<double>();
  if (!std::isfinite(x) || std::abs(x) > 1e12) refuse("a number is out of bounds");
  return x;
}
double coordinate(const Json& json) {
  const double x = number(json);
  if (std::abs(x) > kMost) refuse("a coordinate is out of bounds");
  return x;
}
double length(const Json& json) {
  const double x = coordinate(json);
  if (x < 0.0) refuse("a length is negative");
  return x;
}
int whole(const Json& json) {
  const bool is_whole = json.is_number_integer() && std::abs(json.get<double>()) < 2e9;
  return is_whole ? json.get<int>() : (refuse("a whole number is wanted"), 0);
}
Vec vector(const Json& json) {
  if (json.size() != 3) refuse("a vector has not three numbers");
  return {coordinate(json[0]), coordinate(json[1]), coordinate(json[2])};
}

struct Pose {
  Mat R = Mat::Identity();
  Vec p = Vec::Zero();
  Pose operator*(const Pose& after) const { return {R * after.R, R * after.p + p}; }
};
Pose pose(const Json& json) {
  if (json.size() != 12) refuse("a pose has not twelve numbers");
  Pose T;
  for (int i = 0; i < 12; ++i) {
    (i % 4 == 3 ? T.p[i / 4] : T.R(i / 4, i % 4)) = coordinate(json[i]);
  }
  if (!T.R.isUnitary(1e-12) || !(T.R.determinant() > 0.0)) refuse("a pose does not turn");
  return T;
}

struct Share {  // of a body's items: from the first on, before the last
  std::size_t first = 0, last = 1;
};

/// Convex items: one, or many. How far they reach in a direction is all that is asked of them.
struct Body {
  enum class Kind { kBox, kCylinder, kCapsule, kHalfSpace, kMesh, kCubes, kBalls };
  std::string name;            // by its place in the certificate
  Kind kind = Kind::kCapsule;  // of no length: a sphere
  Vec half = Vec::Zero();      // of a box
  double radius = 0.0, half_length = 0.0;
  std::vector<Vec> points;  // of a mesh; else centres
  std::vector<std::array<std::size_t, 3>> triangles;
  bool is_surface = false;    // a mesh without an inside
  std::vector<double> sizes;  // edges of cubes, radii of balls
  Pose at;                    // in its link, or in the world
  int link = -1;
  std::vector<int> may_touch;  // links that are not held against it

  [[nodiscard]] Share all() const {
    return {0, kind == Kind::kMesh ? triangles.size() : sizes.empty() ? 1 : sizes.size()};
  }
  /// The greatest n . x of all points x of some items, less n . (the body's origin).
  [[nodiscard]] double reach(const Vec& n, const Share& share) const {
    double most = -1e300;
    for (std::size_t i = share.first; i < share.last; ++i) most = std::max(most, reach(n, i));
    return most;
  }
  [[nodiscard]] double reach(const Vec& n, std::size_t item) const {
    switch (kind) {
      case Kind::kBox: return n.cwiseAbs().dot(half);
      case Kind::kCylinder:
        return radius * std::hypot(n.x(), n.y()) + half_length * std::abs(n.z());
      case Kind::kCapsule: return radius * n.norm() + half_length * std::abs(n.z());
      case Kind::kMesh: {
        const auto& [a, b, c] = triangles[item];
        return std::max({n.dot(points[a]), n.dot(points[b]), n.dot(points[c])});
      }
      case Kind::kCubes: return n.dot(points[item]) + 0.5 * sizes[item] * n.cwiseAbs().sum();
      case Kind::kBalls: return n.dot(points[item]) + sizes[item] * n.norm();
      case Kind::kHalfSpace: break;  // along its normal, which is all that is asked of it
    }
    return 0.0;
  }
  /// How far its points are from its origin, at most, on a link.
  [[nodiscard]] double ball() const {
    if (kind == Kind::kBox) return half.norm();
    if (kind == Kind::kCylinder) return std::hypot(radius, half_length);
    if (kind == Kind::kCapsule) return radius + half_length;
    double most = 0.0;
    for (const Vec& p : points) most = std::max(most, p.norm());
    return most;
  }
  [[nodiscard]] Vec point_of(std::size_t item) const {
    if (kind == Kind::kMesh) return points[triangles[item][0]];
    return points.empty() ? Vec::Zero() : points[item];
  }
  /// Whether a mesh has an inside: each side of a triangle is one other's, the other way round.
  [[nodiscard]] bool is_closed() const {
    using Place = std::array<double, 3>;
    const auto place = [&](std::size_t i) {  // on a grid of 1e-6 m
      const Vec p = (1e6 * points[i]).array().round();
      return Place{p.x(), p.y(), p.z()};
    };
    std::map<std::pair<Place, Place>, int> sides;
    for (const auto& [i, j, k] : triangles) {
      const std::array p{place(i), place(j), place(k), place(i)};
      if (p[0] == p[1] || p[1] == p[2] || p[2] == p[0]) continue;
      for (std::size_t c = 0; c < 3; ++c) ++sides[{p[c], p[c + 1]}];
    }
    return std::ranges::all_of(sides, [&](const auto& side) {
      return side.second == 1 && sides.contains({side.first.second, side.first.first});
    });
  }
  /// How often a mesh goes round a point, by the solid angles of its triangles (Van Oosterom and
  /// Strackee 1983).
  [[nodiscard]] double winding(const Vec& p) const {
    double sum = 0.0;
    for (const auto& [i, j, k] : triangles) {
      const Vec a = points[i] - p, b = points[j] - p, c = points[k] - p;
      const double la = a.norm(), lb = b.norm(), lc = c.norm();
      sum += 2.0 * std::atan2(a.dot(b.cross(c)),
                              la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
    }
    return sum / (4.0 * EIGEN_PI);
  }
};

void read_mesh(const Json& json, Body& body) {
  body.kind = Body::Kind::kMesh;
  for (const Json& p : json.at("points")) body.points.push_back(vector(p));
  for (const Json& t : json.at("triangles")) {
    std::array<std::size_t, 3> corners{};
    for (std::size_t k = 0; k < 3; ++k) {
      corners[k] = static_cast<std::size_t>(whole(t.at(k)));  // a negative one is too large
      if (corners[k] >= body.points.size() || t.size() != 3) refuse("a triangle is none");
    }
    body.triangles.push_back(corners);
  }
  if (body.triangles.empty()) refuse("a mesh has no triangles");
  body.is_surface = !body.is_closed();
}

void read_many(const Json& json, Body& body) {
  for (const Json& one : json) {
    if (one.size() != 4) refuse("one of many has not four numbers");
    body.points.push_back(vector({one[0], one[1], one[2]}));
    body.sizes.push_back(length(one.at(3)));
  }
  if (body.sizes.empty()) refuse("there are none of many");
}

Body body(const Json& json, const std::string& name) {
  Body body{.name = name};
  body.at = pose(json.at("pose"));
  std::string kind;
  for (const auto& [key, value] : json.items()) {
    if (key == "pose" || key == "name" || key == "link" || key == "may_touch") continue;
    if (!std::exchange(kind, key).empty()) refuse("a body has one shape");
    if (key == "box") {
      body.kind = Body::Kind::kBox;
      body.half = 0.5 * vector(value);
      if (body.half.minCoeff() < 0.0) refuse("a box has a negative side");
    } else if (key == "sphere") {
      body.radius = length(value);
    } else if (key == "cylinder" || key == "capsule") {
      body.kind = key == "cylinder" ? Body::Kind::kCylinder : Body::Kind::kCapsule;
      body.radius = length(value.at(0));
      body.half_length = 0.5 * length(value.at(1));
    } else if (key == "mesh") {
      read_mesh(value, body);
    } else if (key == "cubes" || key == "balls") {
      body.kind = key == "cubes" ? Body::Kind::kCubes : Body::Kind::kBalls;
      read_many(value, body);
    } else if (key == "half_space") {
      body.kind = Body::Kind::kHalfSpace;
    } else {
      refuse("'" + key + "' is no shape");
    }
  }
  if (kind.empty()) refuse("a body has no shape");
  return body;
}

struct Link {
  int parent = -1;
  Pose at;  // against its parent, where its joint is at zero
  bool turns = false, shifts = false;
  Vec axis = Vec::UnitZ();
  int joint = -1;  // none: it stays at its offset
  double multiplier = 1.0, offset = 0.0;
  [[nodiscard]] bool moves() const { return (turns || shifts) && joint >= 0; }
};

using Terms = std::array<double, 6>;
struct Piece {
  double begin = 0.0, end = 0.0;
  std::vector<Terms> joints;
};

double at(const Terms& c, double s) {
  double sum = 0.0;
  for (int k = 5; k >= 0; --k) sum = sum * s + c[k];
  return sum;
}

/// The greatest |c(s + u) - c(s)| for |u| <= half, or more: by the terms of Taylor's series.
double most_change(Terms c, double s, double half) {
  for (int k = 0; k < 5; ++k) {  // by and by those about s
    for (int i = 4; i >= k; --i) c[i] += s * c[i + 1];
  }
  double sum = 0.0;
  for (int k = 1; k < 6; ++k) sum += std::abs(c[k]) * std::pow(half, k);
  return sum;
}

/// Whether a polynomial stays below a limit from a to b.
bool stays_below(const Terms& c, double a, double b, double limit, int depth = 0) {
  const double middle = 0.5 * (a + b);
  const double there = at(c, middle);
  if (there > limit + kLimitTolerance) return false;
  if (there + most_change(c, middle, 0.5 * (b - a)) <= limit + kLimitTolerance) return true;
  if (depth == kDeepest) return true;  // by less than 2^-40 of the piece
  return stays_below(c, a, middle, limit, depth + 1) && stays_below(c, middle, b, limit, depth + 1);
}

class Recheck {
 public:
  explicit Recheck(const Json& json) : margin_(length(json.at("margin_m"))) {
    if (json.at("format") != "sidestep-certificate-3") refuse("its format is not known");
    read_robot(json.at("robot"));
    for (const Json& object : json.at("objects")) {
      objects_.push_back(body(object, "object " + std::to_string(objects_.size())));
      surfaces_ += objects_.back().is_surface ? 1 : 0;
      for (const Json& link : object.value("may_touch", Json::array())) {
        objects_.back().may_touch.push_back(whole(link));
      }
    }
    read_motion(json.at("motion"));
    check_limits(json.at("robot").at("joints"));
    check_claims(json.at("claims"));
  }
  void print(const char* file) const {
    std::printf(
        "%s: accepted (%zu shapes, %zu objects, %zu surfaces, %zu pairs, %zu may touch, "
        "%g s, margin %g m)\n",
        file, shapes_.size(), objects_.size(), surfaces_, pairs_, excused_, pieces_.back().end,
        margin_);
  }

 private:
  void read_robot(const Json& robot) {
    dof_ = static_cast<int>(robot.at("joints").size());
    for (const Json& json : robot.at("links")) {
      Link link;
      link.parent = whole(json.at("parent"));
      const bool is_after = link.parent >= -1 && link.parent < std::ssize(links_);
      if (!is_after) refuse("a link stands before its parent");
      link.at = pose(json.at("pose"));
      const std::string motion = json.at("motion");
      link.turns = motion == "turn";
      link.shifts = motion == "shift";
      if (!link.turns && !link.shifts && motion != "fixed") refuse("a link moves in no known way");
      link.axis = vector(json.at("axis"));
      if (std::abs(link.axis.norm() - 1.0) > 1e-12) refuse("an axis has not the length 1");
      link.joint = whole(json.at("joint"));
      if (link.joint < -1 || link.joint >= dof_) refuse("there is no such joint");
      link.multiplier = coordinate(json.at("multiplier"));
      link.offset = coordinate(json.at("offset"));
      links_.push_back(link);
    }
    const int links = static_cast<int>(links_.size());
    for (const Json& json : robot.at("shapes")) {
      Body shape = body(json, "shape " + std::to_string(shapes_.size()));
      shape.link = whole(json.at("link"));
      if (shape.link < 0 || shape.link >= links) refuse("a shape has no link");
      if (shape.kind == Body::Kind::kHalfSpace || !shape.sizes.empty()) refuse("a link is none");
      surfaces_ += shape.is_surface ? 1 : 0;
      shapes_.push_back(std::move(shape));
    }
    if (shapes_.empty()) refuse("the robot has no shapes");
    for (const Json& json : robot.at("pairs")) {
      const int a = whole(json.at(0)), b = whole(json.at(1));
      if (a < 0 || b < 0 || a >= links || b >= links || a == b) refuse("a pair is none");
      link_pairs_.emplace_back(a, b);
    }
  }

  void read_motion(const Json& motion) {
    for (const Json& json : motion) {
      Piece piece;
      piece.begin = pieces_.empty() ? 0.0 : pieces_.back().end;
      piece.end = number(json.at("end_s"));
      const double span = piece.end - piece.begin;
      if (!(span > 1e-9)) refuse("time does not go on");
      for (const Json& terms : json.at("joints")) {
        if (terms.size() != 6) refuse("a polynomial has not six terms");
        Terms c;
        for (std::size_t k = 0; k < 6; ++k) c[k] = number(terms[k]);
        if (!(std::abs(at(c, 0.5 * span)) + most_change(c, 0.5 * span, 0.5 * span) < kMost)) {
          refuse("a joint is out of bounds");
        }
        piece.joints.push_back(c);
      }
      if (static_cast<int>(piece.joints.size()) != dof_) refuse("a joint has no motion");
      if (!pieces_.empty()) {
        const Piece& before = pieces_.back();
        for (int j = 0; j < dof_; ++j) {
          const double jump = piece.joints[j][0] - at(before.joints[j], before.end - before.begin);
          if (std::abs(jump) > 1e-9) refuse("the motion jumps");
        }
      }
      pieces_.push_back(std::move(piece));
    }
    if (pieces_.empty()) refuse("there is no motion");
  }

  void check_limits(const Json& joints) const {
    for (int j = 0; j < dof_; ++j) {
      const Json &joint = joints[j], &velocity = joint.at("velocity");
      const auto breaks = [](const Terms& c, double span, const Json& limit, double sign) {
        return !limit.is_null() && !stays_below(c, 0.0, span, sign * number(limit));
      };
      for (const Piece& piece : pieces_) {
        for (const double sign : {-1.0, 1.0}) {
          Terms q{}, speed{};
          for (int k = 0; k < 6; ++k) q[k] = sign * piece.joints[j][k];
          for (int k = 1; k < 6; ++k) speed[k - 1] = k * q[k];
          const double span = piece.end - piece.begin;
          if (breaks(q, span, joint.at(sign < 0.0 ? "lower" : "upper"), sign) ||
              breaks(speed, span, velocity, 1.0)) {
            refuse("joint " + joint.at("name").get<std::string>() + " breaks a limit");
          }
        }
      }
    }
  }

  /// The links from one up to an ancestor, without that, that joints move: the last first.
  [[nodiscard]] std::vector<int> movers(int link, int ancestor) const {
    std::vector<int> found;
    for (; link != ancestor; link = links_[link].parent) {
      if (link < 0) refuse("a link is none of its ancestor's");
      if (links_[link].moves()) found.push_back(link);
    }
    return found;
  }
  [[nodiscard]] int common_ancestor(int a, int b) const {
    while (a != b) (a > b ? a : b) = links_[std::max(a, b)].parent;  // which stand before them
    return a;
  }

  /// The claims are there for all that has to be apart, once each, and hold.
  void check_claims(const Json& claims) {
    for (const Json& claim : claims) {
      const bool is_own = claim.contains("other");
      const int other = whole(claim.at(is_own ? "other" : "object"));
      const std::string of = "shape " + std::to_string(whole(claim.at("shape"))) + " and " +
                             (is_own ? "shape " : "object ") + std::to_string(other);
      if (!claims_.emplace(of, &claim.at("parts")).second) refuse("two claims are of " + of);
    }
    for (std::size_t s = 0; s < shapes_.size(); ++s) {
      const std::vector<int> moves = movers(shapes_[s].link, -1);
      if (moves.empty()) continue;  // what no joint moves
      for (std::size_t o = 0; o < objects_.size(); ++o) {
        const bool may_touch = std::ranges::count(objects_[o].may_touch, shapes_[s].link) > 0;
        excused_ += may_touch ? 1 : 0;
        if (!may_touch) check_pair(shapes_[s], objects_[o], moves, {});
      }
    }
    for (const auto& [a, b] : link_pairs_) {
      const int ancestor = common_ancestor(a, b);
      for (std::size_t s = 0; s < shapes_.size(); ++s) {
        for (std::size_t t = 0; t < shapes_.size(); ++t) {
          if (shapes_[s].link != a || shapes_[t].link != b) continue;
          check_pair(shapes_[s], shapes_[t], movers(a, ancestor), movers(b, ancestor));
        }
      }
    }
    if (!claims_.empty()) refuse("what is claimed is not to be shown: " + claims_.begin()->first);
  }

  /// The robot in the middle of a part, and how far each joint goes from there in that part.
  struct State {
    std::vector<Pose> links;
    std::vector<double> changes;
  };

  /// Two bodies, the links that move them, and of each the items that are looked at.
  struct Pair {
    const Body &a, &b;
    const std::vector<int>&moves_a, &moves_b;
    Share of_a, of_b;
  };

  void check_pair(const Body& a, const Body& b, const std::vector<int>& moves_a,
                  const std::vector<int>& moves_b) {
    ++pairs_;
    const std::string of = a.name + " and " + b.name;
    const auto claim = claims_.extract(of);
    if (claim.empty()) refuse("nothing is claimed of " + of);
    check_outside(a, b);
    check_outside(b, a);
    check(Pair{a, b, moves_a, moves_b, a.all(), b.all()}, 0, 0, *claim.mapped());
  }

  [[nodiscard]] static Pose placed(const Body& body, const State& state) {
    return body.link >= 0 ? state.links[body.link] * body.at : body.at;
  }

  /// In the beginning nothing is inside of a mesh; that it does not come there, its triangles show.
  void check_outside(const Body& mesh, const Body& other) {
    if (mesh.triangles.empty() || mesh.is_surface || other.kind == Body::Kind::kHalfSpace) return;
    Eigen::AlignedBox3d bounds;
    for (const Vec& p : mesh.points) bounds.extend(p);
    const State& state = this->state(kDeepest, 0);
    const Pose at_mesh = placed(mesh, state), at_other = placed(other, state);
    for (std::size_t i = 0; i < other.all().last; ++i) {
      const Vec world = at_other.R * other.point_of(i) + at_other.p;
      const Vec p = at_mesh.R.transpose() * (world - at_mesh.p);
      if (bounds.contains(p) && std::abs(mesh.winding(p)) > 0.5)
        refuse(other.name + " is in " + mesh.name);
    }
  }

  /// Two bodies are apart in a part of the motion, as a tree shows it: a direction, or two trees
  /// for the halves of the time, or of the items of the first or of the second body.
  void check(const Pair& pair, int level, std::int64_t index, const Json& tree) {
    if (tree.size() != 3) refuse("a tree has three numbers, or two halves");
    if (!tree[0].is_string()) {
      const Vec direction(whole(tree[0]), whole(tree[1]), whole(tree[2]));
      const double spare = gap(pair, level, index, direction) - margin_;
      if (!(spare > kRounding_m)) refuse(pair.a.name + " is not shown apart from " + pair.b.name);
      return;
    }
    const auto& halved = tree[0].get_ref<const std::string&>();
    if (halved == "time") {
      if (level == kDeepest) refuse("a part of the motion is too short");
      check(pair, level + 1, 2 * index, tree[1]);
      check(pair, level + 1, 2 * index + 1, tree[2]);
      return;
    }
    if (halved != "first" && halved != "second") refuse("'" + halved + "' cannot be halved");
    Pair before = pair, after = pair;
    const bool is_of_a = halved == "first";
    const Share& share = is_of_a ? pair.of_a : pair.of_b;
    const std::size_t middle = (share.first + share.last) / 2;
    if (middle == share.first) refuse("one item cannot be halved");
    (is_of_a ? before.of_a : before.of_b).last = middle;
    (is_of_a ? after.of_a : after.of_b).first = middle;
    check(before, level, index, tree[1]);
    check(after, level, index, tree[2]);
  }

  /// How far apart two bodies stay in a part of the motion, at least.
  [[nodiscard]] double gap(const Pair& pair, int level, std::int64_t index, const Vec& direction) {
    const auto& [a, b, moves_a, moves_b, of_a, of_b] = pair;
    const State& state = this->state(level, index);
    const Pose at_a = placed(a, state), at_b = placed(b, state);
    const Vec n =
        b.kind == Body::Kind::kHalfSpace ? Vec(-at_b.R.col(2)) : Vec(direction.normalized());
    if (!(n.norm() > 0.5)) refuse("a direction is none");
    return n.dot(at_b.p - at_a.p) - a.reach(at_a.R.transpose() * n, of_a) -
           b.reach(at_b.R.transpose() * -n, of_b) - way(state, a, at_a, moves_a, n) -
           way(state, b, at_b, moves_b, n);
  }

  const State& state(int level, std::int64_t index) {
    const auto [found, is_new] = states_.try_emplace({level, index});
    State& state = found->second;
    if (!is_new) return state;
    const double step = std::ldexp(pieces_.back().end, -level);
    const double from = step * static_cast<double>(index), to = from + step;
    const double middle = 0.5 * (from + to);
    std::size_t here = 0;
    while (here + 1 < pieces_.size() && pieces_[here].end <= middle) ++here;
    std::vector<double> q(dof_);
    for (int j = 0; j < dof_; ++j) {
      q[j] = at(pieces_[here].joints[j], middle - pieces_[here].begin);
    }
    state.changes.assign(dof_, 0.0);
    // Times are rounded, too: what is next to a part counts with it.
    const double more = 1e-14 * pieces_.back().end;
    for (const Piece& piece : pieces_) {
      const double a = std::max(from - more, piece.begin) - piece.begin;
      const double b = std::min(to + more, piece.end) - piece.begin;
      if (a > b) continue;
      for (int j = 0; j < dof_; ++j) {
        const Terms& c = piece.joints[j];
        const double s = 0.5 * (a + b);
        const double change = std::abs(at(c, s) - q[j]) + most_change(c, s, 0.5 * (b - a));
        state.changes[j] = std::max(state.changes[j], change);
      }
    }
    for (const Link& link : links_) {
      Pose T = link.parent >= 0 ? state.links[link.parent] * link.at : link.at;
      const double value = link.offset + (link.joint >= 0 ? link.multiplier * q[link.joint] : 0.0);
      if (!(T.p.norm() < kMost && std::abs(value) < kMost)) refuse("a link is out of bounds");
      if (link.turns) T.R = T.R * Eigen::AngleAxisd(value, link.axis).toRotationMatrix();
      if (link.shifts) T.p += value * (T.R * link.axis);
      state.links.push_back(T);
    }
    return state;
  }

  /// How far any point of a body comes along n from where it is in the middle of a part. From the
  /// body inwards: a joint that turns by no more than `change` moves a point that has come `sum`
  /// from its place by no more than change * (its distance from the axis + sum).
  [[nodiscard]] double way(const State& state, const Body& body, const Pose& at,
                           const std::vector<int>& movers, const Vec& n) const {
    const double ball = movers.empty() ? 0.0 : body.ball();
    double sum = 0.0, along = 0.0;
    for (const int number : movers) {
      const Link& link = links_[number];
      const double change = std::abs(link.multiplier) * state.changes[link.joint];
      const Pose& T = state.links[number];
      const Vec axis = T.R * link.axis, turn = link.turns ? axis.cross(at.p - T.p) : axis;
      const double more = link.turns ? ball + sum : 0.0, way = change * (turn.norm() + more);
      // |sin x| <= |x|, 1 - cos x <= x^2 / 2
      along += change * (std::abs(n.dot(turn)) + more) + (link.turns ? 0.5 * change * way : 0.0);
      sum += way;
    }
    return std::min(sum, along);
  }

  double margin_;
  std::size_t pairs_ = 0, excused_ = 0, surfaces_ = 0;  ///< Looked at; may touch; open meshes.
  int dof_ = 0;
  std::vector<Link> links_;
  std::vector<Body> shapes_, objects_;
  std::vector<std::pair<int, int>> link_pairs_;
  std::vector<Piece> pieces_;
  std::map<std::string, const Json*> claims_;  // by the two that they are of
  std::map<std::pair<int, std::int64_t>, State> states_;
};

/// Refuses what is nested deeper than any tree: what goes through it recurses. Refuses a key that
/// an object has twice, of which the last would be read.
Json parse(std::istream& in) {
  using Event = Json::parse_event_t;
  std::vector<std::set<std::string>> keys;  // of the objects that are open
  return Json::parse(in, [&](int depth, Event event, const Json& value) {
    if (depth > 200) refuse("it is nested too deeply");
    if (event == Event::object_start) keys.emplace_back();
    if (event == Event::object_end) keys.pop_back();
    if (event == Event::key && !keys.back().insert(value.get<std::string>()).second) {
      refuse("an object has the key '" + value.get<std::string>() + "' twice");
    }
    return true;
  });
}

int recheck(const char* file) {
  std::ifstream in(file);
  if (in.peek() == EOF) in.close();  // a folder
  try {
    Recheck(parse(in)).print(file);
    return 0;
  } catch (const Json::parse_error&) {
    std::fprintf(stderr, "%s: cannot be read, or is not JSON\n", file);
    return 4;
  } catch (const std::exception& error) {
    std::printf("%s: refused: %s\n", file, error.what());
    return 1;
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2 || std::string(argv[1]) == "--help") {
    std::printf("sidestep_recheck CERTIFICATE...\n0: accepted; 1: refused; 4: cannot be read\n");
    return argc < 2 ? 2 : 0;
  }
  int worst = 0;
  for (int i = 1; i < argc; ++i) worst = std::max(worst, recheck(argv[i]));
  return worst;
}
