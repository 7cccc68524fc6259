#include <sidestep/report/chart.hpp>
