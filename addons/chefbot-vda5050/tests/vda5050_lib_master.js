// A master with vda-5050-lib: drives the robot chefbot/r1 on the broker at the port in argv, and prints what its events
// told as a JSON list. Nodes are on a line along x, one metre apart.
const { MasterController } = require("vda-5050-lib");

const robot = { manufacturer: "chefbot", serialNumber: "r1" };
const events = [];

function node(index, released = true) {
  const nodePosition = { x: index, y: 0, mapId: "flat" };
  return { nodeId: `n${index}`, sequenceId: 2 * index, released, nodePosition, actions: [] };
}

function edge(index, released = true) {
  return {
    edgeId: `e${index}`,
    sequenceId: 2 * index + 1,
    released,
    startNodeId: `n${index}`,
    endNodeId: `n${index + 1}`,
    actions: [],
  };
}

function assign(master, order) {
  return new Promise((resolve, reject) => {
    const handler = {
      onOrderProcessed: (error, canceled, active, { order }) => {
        const name = `${order.orderId}/${order.orderUpdateId}`;
        if (error) events.push(`refused ${order.orderId}: ${error.errorType}`);
        else events.push(`processed ${name}${active ? " active" : ""}${canceled ? " cancelled" : ""}`);
        resolve();
      },
      onNodeTraversed: (node) => order.orderId === "o1" && events.push(`node ${node.nodeId}`),
      onEdgeTraversing: (edge, start, end, changes, times) =>
        order.orderId === "o1" && order.orderUpdateId === 0 && times === 1 && events.push(`traversing ${edge.edgeId}`),
      onEdgeTraversed: (edge) => order.orderId === "o1" && order.orderUpdateId === 0 && events.push(`edge ${edge.edgeId}`),
    };
    master.assignOrder(robot, order, handler).catch(reject);
  });
}

function act(master, actionType, parameters = {}) {
  const actionParameters = Object.entries(parameters).map(([key, value]) => ({ key, value }));
  const action = { actionType, actionId: `${actionType}-1`, blockingType: "NONE", actionParameters };
  return new Promise((resolve, reject) => {
    const handler = {
      onActionStateChanged: (state) => {
        if (!["FINISHED", "FAILED"].includes(state.actionStatus)) return;
        events.push(`${actionType} ${state.actionStatus}`);
        resolve();
      },
      onActionError: () => {},
    };
    master.initiateInstantActions(robot, { instantActions: [action] }, handler).catch(reject);
  });
}

async function main() {
  const options = {
    interfaceName: "uagv",
    transport: { brokerUrl: `mqtt://127.0.0.1:${process.argv[2]}` },
    vdaVersion: "2.0.0",
    topicObjectValidation: { inbound: true, outbound: true },
  };
  const master = new MasterController(options, { targetAgvs: robot });
  await master.start();
  await assign(master, {
    orderId: "o1",
    orderUpdateId: 0,
    nodes: [node(0), node(1), node(2, false)],
    edges: [edge(0), edge(1, false)],
  });
  await assign(master, { orderId: "o1", orderUpdateId: 1, nodes: [node(1), node(2)], edges: [edge(1)] });
  await assign(master, { orderId: "o2", orderUpdateId: 0, nodes: [node(8), node(9)], edges: [edge(8)] });
  await act(master, "say", { text: "Hello" });
  await act(master, "dance");
  const long = assign(master, {
    orderId: "o3",
    orderUpdateId: 0,
    nodes: [node(2), node(3), node(4), node(5), node(6), node(7), node(8), node(9)],
    edges: [edge(2), edge(3), edge(4), edge(5), edge(6), edge(7), edge(8)],
  });
  await new Promise((resolve) => setTimeout(resolve, 300));
  await act(master, "cancelOrder");
  await long;
  await master.stop();
  process.stdout.write(JSON.stringify(events));
}

main().catch((error) => {
  console.error(error);
  process.exit(1);
});
