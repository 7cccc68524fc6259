#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <sidestep/geometry/orca.hpp>
#include <sidestep/geometry/people.hpp>
#include <sidestep/geometry/scene.hpp>

namespace sidestep {

/// Draws a scene's people by a seed and their groups' names, and adds their bodies, where they
/// start, to its objects. Fails as Scene::drawn() does. [any]
[[nodiscard]] Result<Scene> with_people(std::vector<SceneObject> objects, const People& people,
                                        std::uint64_t seed);

/// The people of a drawn scene while they walk, each at even velocity within a step. One thread.
class Crowd {
 public:
  /// Of Scene::drawn().
  explicit Crowd(const Scene& scene);

  /// Whether where the robot is makes a difference to any of them.
  [[nodiscard]] bool sees_robot() const noexcept { return sees_robot_; }

  /// Takes all steps that begin before a time; false where there was none. `robot`: as those who
  /// see it do, where it is known.
  bool advance(double until_s, const std::optional<OrcaAgent>& robot);

  /// Number of the scene's first object that is part of a person; the rest are, too.
  [[nodiscard]] std::size_t first_body() const noexcept;
  /// Where those are at a time until which advance() went.
  [[nodiscard]] std::vector<Transform> poses(double time_s) const;

  /// The scene with all ways that have been walked so far.
  [[nodiscard]] Scene scene() const { return Scene(objects_, people_); }

 private:
  struct Walker {
    Eigen::Vector2d place_m = Eigen::Vector2d::Zero();
    Eigen::Vector2d velocity_mps = Eigen::Vector2d::Zero();
    double heading_rad = 0.0;
    double stride_rad = 0.0;  ///< Phase of the legs.
    std::size_t next = 1;     ///< Of the route.
    double stuck_s = 0.0;     ///< For so long it has got nowhere.
    double hunts_s = 0.0;     ///< For so long it has hunted; if negative, for so long it will not.
    std::size_t object = 0;   ///< The first of its body.
    bool is_there = true;
  };

  void follow_robot(const OrcaAgent& robot);
  void appear(std::size_t index, const OrcaAgent& robot);
  [[nodiscard]] Eigen::Vector2d preferred(const Person& person, Walker& walker) const;
  [[nodiscard]] Eigen::Vector2d hunt(const Person& person, Walker& walker,
                                     const std::optional<OrcaAgent>& robot) const;
  [[nodiscard]] Eigen::Vector2d choose(std::size_t index, const Eigen::Vector2d& preferred_mps,
                                       const std::optional<OrcaAgent>& robot) const;
  void note_bodies(std::size_t index, bool was_there);

  std::vector<SceneObject> objects_;
  People people_;
  Scene standing_;  ///< What people walk around.
  std::vector<Walker> walkers_;
  std::int64_t steps_ = 0;  ///< Taken.
  bool sees_robot_ = false;
  std::optional<Eigen::Vector2d> robot_m_;  ///< Where it was last.
  double robot_way_m_ = 0.0;                ///< How far it has gone.
};

/// The scene with its people's ways up to People::duration_s, none of whom sees a robot; a scene
/// without people as it is. [any]
[[nodiscard]] Scene walked(const Scene& drawn);

}  // namespace sidestep
