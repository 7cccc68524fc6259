#include "planners.hpp"

#include <charconv>
#include <cmath>
#include <functional>
#include <memory>
#include <utility>

#include <ompl/base/OptimizationObjective.h>
#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <ompl/geometric/planners/AnytimePathShortening.h>
#include <ompl/geometric/planners/cforest/CForest.h>
#include <ompl/geometric/planners/est/BiEST.h>
#include <ompl/geometric/planners/est/EST.h>
#include <ompl/geometric/planners/est/ProjEST.h>
#include <ompl/geometric/planners/fmt/BFMT.h>
#include <ompl/geometric/planners/fmt/FMT.h>
#include <ompl/geometric/planners/informedtrees/ABITstar.h>
#include <ompl/geometric/planners/informedtrees/AITstar.h>
#include <ompl/geometric/planners/informedtrees/BITstar.h>
#include <ompl/geometric/planners/kpiece/BKPIECE1.h>
#include <ompl/geometric/planners/kpiece/KPIECE1.h>
#include <ompl/geometric/planners/kpiece/LBKPIECE1.h>
#include <ompl/geometric/planners/pdst/PDST.h>
#include <ompl/geometric/planners/prm/LazyPRM.h>
#include <ompl/geometric/planners/prm/LazyPRMstar.h>
#include <ompl/geometric/planners/prm/PRM.h>
#include <ompl/geometric/planners/prm/SPARS.h>
#include <ompl/geometric/planners/prm/SPARStwo.h>
#include <ompl/geometric/planners/rlrt/BiRLRT.h>
#include <ompl/geometric/planners/rlrt/RLRT.h>
#include <ompl/geometric/planners/rrt/BiTRRT.h>
#include <ompl/geometric/planners/rrt/InformedRRTstar.h>
#include <ompl/geometric/planners/rrt/LBTRRT.h>
#include <ompl/geometric/planners/rrt/LazyRRT.h>
#include <ompl/geometric/planners/rrt/RRT.h>
#include <ompl/geometric/planners/rrt/RRTConnect.h>
#include <ompl/geometric/planners/rrt/RRTXstatic.h>
#include <ompl/geometric/planners/rrt/RRTsharp.h>
#include <ompl/geometric/planners/rrt/RRTstar.h>
#include <ompl/geometric/planners/rrt/SORRTstar.h>
#include <ompl/geometric/planners/rrt/TRRT.h>
#include <ompl/geometric/planners/rrt/pRRT.h>
#include <ompl/geometric/planners/sbl/SBL.h>
#include <ompl/geometric/planners/sbl/pSBL.h>
#include <ompl/geometric/planners/stride/STRIDE.h>
#include <ompl/util/RandomNumbers.h>

#include "flat_nearest.hpp"

namespace sidestep::ompl_optimiser {
namespace {

std::mutex session_mutex;  // guards OMPL's globals, which are the process's, too

}  // namespace

Session::Session(std::uint64_t seed, Log& log)
    : lock_(session_mutex), log_(log), previous_(::ompl::msg::getOutputHandler()) {
  // Seeding a second time works, but OMPL calls it an error: silence it.
  ::ompl::msg::noOutputHandler();
  ::ompl::RNG::setSeed(static_cast<std::uint_fast32_t>(seed % 0x7fffffffu) + 1u);
  ::ompl::msg::useOutputHandler(this);
}

Session::~Session() { ::ompl::msg::useOutputHandler(previous_); }

void Session::log(const std::string& text, ::ompl::msg::LogLevel level, const char*, int) {
  if (level >= ::ompl::msg::LOG_ERROR) {
    log_.error("OMPL: " + text);
  } else if (level == ::ompl::msg::LOG_WARN) {
    log_.warn("OMPL: " + text);
  } else {
    log_.debug("OMPL: " + text);
  }
}

namespace {

namespace ob = ::ompl::base;
namespace og = ::ompl::geometric;

using Maker = std::function<ob::PlannerPtr(const ob::SpaceInformationPtr&)>;

template <class Planner>
std::pair<const std::string, Maker> entry(const char* name) {
  return {name, [](const ob::SpaceInformationPtr& of) { return std::make_shared<Planner>(of); }};
}

/// PRM, except that it counts instead of looking at the clock, and looks for a path between two
/// rounds of growth instead of from a thread beside it: equal seeds give equal roadmaps. With
/// `star`, PRM*: as many connections as the number of milestones asks for.
class CountingPrm final : public og::PRM {
 public:
  explicit CountingPrm(const ob::SpaceInformationPtr& information, bool star = false)
      : og::PRM(information, star) {
    if (star) setName("PRMstar");
  }

  ob::PlannerStatus solve(const ob::PlannerTerminationCondition& done) override {
    checkValidity();
    while (const ob::State* start = pis_.nextStart()) {
      startM_.push_back(addMilestone(si_->cloneState(start)));
    }
    while (const ob::State* goal = pis_.nextGoal()) {
      goalM_.push_back(addMilestone(si_->cloneState(goal)));
    }
    if (startM_.empty()) return ob::PlannerStatus::INVALID_START;
    if (goalM_.empty()) return ob::PlannerStatus::INVALID_GOAL;
    bestCost_ = opt_->infiniteCost();
    addedNewSolution_ = false;
    ob::PathPtr path;
    while (true) {
      // Its result says whether the path is good enough for the objective: any is.
      (void)maybeConstructSolution(startM_, goalM_, path);
      if (path) break;
      if (done) return ob::PlannerStatus::TIMEOUT;
      growRoadmap(counted(done, kGrowSamples));
      expandRoadmap(counted(done, kExpandSamples));
    }
    pdef_->addSolutionPath(path, false, 0.0, getName());
    return ob::PlannerStatus::EXACT_SOLUTION;
  }

 private:
  static constexpr int kGrowSamples = 40;
  static constexpr int kExpandSamples = 10;

  static ob::PlannerTerminationCondition counted(const ob::PlannerTerminationCondition& done,
                                                 int count) {
    return ob::PlannerTerminationCondition(
        [&done, count]() mutable { return count-- <= 0 || done; });
  }
};

/// RRTConnect, except that it looks for the nearest motion in lanes: the same planner, sooner.
class FlatRrtConnect final : public og::RRTConnect {
 public:
  using og::RRTConnect::RRTConnect;
  void setup() override {
    if (si_->getStateSpace()->isMetricSpace()) {  // else its distances are not Euclidean
      if (!tStart_) tStart_ = std::make_shared<FlatNearest<Motion*>>(si_->getStateDimension());
      if (!tGoal_) tGoal_ = std::make_shared<FlatNearest<Motion*>>(si_->getStateDimension());
    }
    og::RRTConnect::setup();
  }
};

/// All but those that need what a problem has not: VFRRT a vector field, TSRRT a task space, XXL a
/// decomposition, QRRT a chain of simpler robots, Lightning and Thunder a base of old plans, SST
/// a goal that random motions can hit; and LazyLBTRRT, of which OMPL 1.5 asserts what is not so,
/// and ends the process.
std::map<std::string, Maker> makers() {
  return {
      entry<og::ABITstar>("ABITstar"),
      entry<og::AITstar>("AITstar"),
      entry<og::AnytimePathShortening>("AnytimePathShortening"),
      entry<og::BFMT>("BFMT"),
      entry<og::BITstar>("BITstar"),
      entry<og::BKPIECE1>("BKPIECE1"),
      entry<og::BiEST>("BiEST"),
      entry<og::BiRLRT>("BiRLRT"),
      entry<og::BiTRRT>("BiTRRT"),
      entry<og::CForest>("CForest"),
      entry<og::EST>("EST"),
      entry<og::FMT>("FMT"),
      entry<og::InformedRRTstar>("InformedRRTstar"),
      entry<og::KPIECE1>("KPIECE1"),
      entry<og::LBKPIECE1>("LBKPIECE1"),
      entry<og::LBTRRT>("LBTRRT"),
      entry<og::LazyPRM>("LazyPRM"),
      entry<og::LazyPRMstar>("LazyPRMstar"),
      entry<og::LazyRRT>("LazyRRT"),
      entry<og::PDST>("PDST"),
      entry<CountingPrm>("PRM"),
      {"PRMstar", [](const auto& of) { return std::make_shared<CountingPrm>(of, true); }},
      entry<og::ProjEST>("ProjEST"),
      entry<og::RLRT>("RLRT"),
      entry<og::RRT>("RRT"),
      entry<FlatRrtConnect>("RRTConnect"),
      entry<og::RRTXstatic>("RRTXstatic"),
      entry<og::RRTsharp>("RRTsharp"),
      entry<og::RRTstar>("RRTstar"),
      entry<og::SBL>("SBL"),
      entry<og::SORRTstar>("SORRTstar"),
      entry<og::SPARS>("SPARS"),
      entry<og::SPARStwo>("SPARStwo"),
      entry<og::STRIDE>("STRIDE"),
      entry<og::TRRT>("TRRT"),
      entry<og::pRRT>("pRRT"),
      entry<og::pSBL>("pSBL"),
  };
}

/// All of it: OMPL itself reads but the beginning of a text.
bool is_number(const std::string& text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc{} && end == text.data() + text.size() && std::isfinite(value);
}

class Silence final : public Log {
 public:
  void write(LogLevel, std::string_view) override {}
};

/// Calls with a planner that searches nothing.
template <class Call>
auto with_idle_planner(const std::string& name, Call&& call) {
  Silence silence;
  const Session session(1, silence);
  auto space = std::make_shared<ob::RealVectorStateSpace>(2);
  space->setBounds(0.0, 1.0);
  const auto information = std::make_shared<ob::SpaceInformation>(space);
  const ob::PlannerPtr planner = make_planner(information, name);
  return call(*planner);
}

}  // namespace

std::vector<std::string> planner_names() {
  std::vector<std::string> names;
  for (const auto& [name, make] : makers()) names.push_back(name);
  return names;
}

ob::PlannerPtr make_planner(const ob::SpaceInformationPtr& information, const std::string& name) {
  return makers().at(name)(information);
}

std::map<std::string, std::string> parameters_of(const std::string& name) {
  return with_idle_planner(name, [](const ob::Planner& planner) {
    std::map<std::string, std::string> parameters;
    planner.params().getParams(parameters);
    return parameters;
  });
}

std::string set_parameter(ob::Planner& planner, const std::string& name, const std::string& value) {
  std::string now;
  (void)planner.params().getParam(name, now);
  if (is_number(now) && !is_number(value) && value != "true" && value != "false") {
    return "must be a number, not '" + value + "'";
  }
  const std::string written = value == "true" ? "1" : value == "false" ? "0" : value;
  try {
    if (planner.params().setParam(name, written)) return {};
  } catch (const std::exception& error) {
    return "cannot be '" + value + "': " + error.what();
  }
  return "cannot be '" + value + "'";
}

std::string try_parameter(const std::string& planner, const std::string& name,
                          const std::string& value) {
  return with_idle_planner(planner,
                           [&](ob::Planner& idle) { return set_parameter(idle, name, value); });
}

}  // namespace sidestep::ompl_optimiser
