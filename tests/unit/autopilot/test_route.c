#include "autopilot/route.h"
#include "unity.h"

static const route_waypoint_t SQUARE[] = {{1000, 0}, {1000, 1000}, {0, 1000}, {0, 0}};
static route_t route;

void setUp(void)
{
    route = (route_t){0};
}
void tearDown(void) {}

static void test_route_takes_1_to_32_waypoints(void)
{
    route_waypoint_t many[33];
    for (int i = 0; i < 33; i++)
        many[i] = (route_waypoint_t){.x_mm = (int16_t)i, .y_mm = 0};
    TEST_ASSERT_EQUAL(ROUTE_OK, route_set(&route, many, 1));
    TEST_ASSERT_EQUAL(ROUTE_OK, route_set(&route, many, 32));
    TEST_ASSERT_EQUAL(ROUTE_TOO_LONG, route_set(&route, many, 33));
    TEST_ASSERT_EQUAL(ROUTE_EMPTY, route_set(&route, many, 0));
}

static void test_route_takes_a_square_that_returns_to_its_start(void)
{
    TEST_ASSERT_EQUAL(ROUTE_OK, route_set(&route, SQUARE, 4));
    TEST_ASSERT_EQUAL_PTR(SQUARE, route.waypoints);
    TEST_ASSERT_EQUAL_UINT8(4, route.count);
}

static void test_route_refuses_a_waypoint_twice_in_a_row(void)
{
    static const route_waypoint_t TWICE[] = {{0, 500}, {300, 400}, {300, 400}};
    TEST_ASSERT_EQUAL(ROUTE_REPEATED, route_set(&route, TWICE, 3));
}

static void test_route_refuses_what_is_farther_than_30_m(void)
{
    static const route_waypoint_t FAR_X[] = {{0, 0}, {30001, 0}};
    static const route_waypoint_t FAR_Y[] = {{0, INT16_MIN}};
    static const route_waypoint_t FARTHEST[] = {{-30000, 30000}};
    TEST_ASSERT_EQUAL(ROUTE_TOO_FAR, route_set(&route, FAR_X, 2));
    TEST_ASSERT_EQUAL(ROUTE_TOO_FAR, route_set(&route, FAR_Y, 1));
    TEST_ASSERT_EQUAL(ROUTE_OK, route_set(&route, FARTHEST, 1));
}

static void test_route_refused_leaves_the_old_one(void)
{
    static const route_waypoint_t TWICE[] = {{0, 500}, {0, 500}};
    route_set(&route, SQUARE, 4);
    TEST_ASSERT_EQUAL(ROUTE_REPEATED, route_set(&route, TWICE, 2));
    TEST_ASSERT_EQUAL_PTR(SQUARE, route.waypoints);
    TEST_ASSERT_EQUAL_UINT8(4, route.count);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_route_takes_1_to_32_waypoints);
    RUN_TEST(test_route_takes_a_square_that_returns_to_its_start);
    RUN_TEST(test_route_refuses_a_waypoint_twice_in_a_row);
    RUN_TEST(test_route_refuses_what_is_farther_than_30_m);
    RUN_TEST(test_route_refused_leaves_the_old_one);
    return UNITY_END();
}
