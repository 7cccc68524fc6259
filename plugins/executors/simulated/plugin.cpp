#include <sidestep/plugin/plugin.hpp>

#include "simulated_executor.hpp"

SIDESTEP_PLUGIN(sidestep::Executor, sidestep::simulated::Options,
                sidestep::simulated::create_executor, "simulated", "0.1.0",
                "A robot that tracks trajectories within its limits, late and inexactly if asked")
